/* scatter.cl - from the records of materials to what they do at points.
 */
#include "lib/lights.cl"
#include "lib/materials/materials.cl"

/* level_at - a number or a grey texture of it. */
INLINE realv level_at(const looks_t *looks, real value, int texture, const placev *at) {
  if (texture < 0) return (realv)value;
  return grey_weight(looks->textures + texture, looks->texels, at);
}

/* resolve - the material of every lane, where materials are mixed or differ by side.
 *
 * chance   a number in [0, 1) that chooses among mixed materials
 */
INLINE intv resolve(const looks_t *looks, intv substance, const pointv *point, realv chance) {
#if HAS_COMBINED
  for (int depth = 0; depth < MOST_COMBINED; ++depth) {
    intv left = substance;
    intv result = substance;
    int is_done = 1;
    for (;;) {
      maskv here;
      const int number = next_number(&left, &here);
      if (number < 0) break;
      global const substance_t *of = looks->substances + number;
      if (of->kind == SUBSTANCE_TWO_SIDED) {
        is_done = 0;
        intv child = select_int(point->is_front, (intv)of->first, (intv)of->second);
        result = select_int(here, child, result);
      } else if (of->kind == SUBSTANCE_MIX) {
        is_done = 0;
        realv weight = level_at(looks, of->weight, of->weight_texture, &point->at);
        maskv is_second = chance < weight;
        /* The rest of the number is as even as the number was. */
        realv rest = is_second ? chance / weight : (chance - weight) / (1 - weight);
        chance = here ? smaller(rest, (realv)R(0.9999999)) : chance;
        result = select_int(here, select_int(is_second, (intv)of->second, (intv)of->first), result);
      }
    }
    substance = result;
    if (is_done) break;
  }
#endif
  return substance;
}

/* closure_of - a material at points. */
INLINE void closure_of(const looks_t *looks, global const substance_t *of, const bandv *band,
                       const pointv *point, closurev *c) {
  c->kind = of->kind;
  c->is_polished = of->is_polished;
  c->alpha = c->index = (realv)1;
  c->inner = (realv)0;
#if HAS_MIRRORS || HAS_DIELECTRICS || HAS_COATED
  if (!of->is_polished)
    c->alpha = larger(level_at(looks, of->roughness, of->roughness_texture, &point->at),
                      (realv)R(1e-3));
#endif
#if HAS_DIELECTRICS
  if (of->kind == SUBSTANCE_DIELECTRIC) {
    realv index = band_value(looks->spectra, looks->n_columns, of->index_row, band);
    c->index = point->is_front ? index : 1 / index;
    return;
  }
#endif
#if HAS_COATED
  if (of->kind == SUBSTANCE_COATED) {
    c->index = band_value(looks->spectra, looks->n_columns, of->index_row, band);
    c->inner = band_value(looks->spectra, looks->n_columns, of->index_row + 1, band);
  }
#endif
  textured4(looks->textures, of->texture, looks->texels, looks->spectra, looks->n_columns, of->row,
            band, &point->at, &c->albedo);
#if HAS_TRANSLUCENT || HAS_CONDUCTORS
  if (of->other_row >= 0)
    spectrum4(looks->spectra, looks->n_columns, of->other_row, band, &c->other);
  else
    for (int k = 0; k < 4; ++k) c->other.w[k] = (realv)0;
#endif
}

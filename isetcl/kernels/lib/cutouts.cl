/* cutouts.cl - surfaces that let some light pass as if they were not there.
 */
#include "lib/lights.cl"
#include "lib/sobol.cl"

/* opacity_at - opacity of what rays hit, and whether it adds light without hiding any. */
SHARED realv opacity_at(const shapes_t *shapes, const triangles_t *triangles,
                        const looks_t *looks, const pathv *ray, const shape_hitv *hit,
                        maskv *is_additive) {
  realv opacity = 1;
  maskv additive = ray->ox != ray->ox;
  intv left = hit->object;
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    global const object_t *object = looks->objects + number;
    additive = additive | (here & mask_from_int((intv)(object->is_additive ? -1 : 0)));
    pointv point;
    point.at.u = point.at.v = point.at.width_u = point.at.width_v = (realv)0;
    if (object->opacity_texture >= 0)
      meet(shapes, triangles, object, ray, hit, here, (realv)0, &point);
    realv value = opacity_of(looks, object, &point.at);
    opacity = here ? value : opacity;
  }
  *is_additive = additive;
  return opacity;
}

/* hash_of_real - bits made of a number. */
INLINE uintv hash_of_real(realv x) {
#if DOUBLE_PRECISION
#if WIDTH == 1
  return as_uint((float)x);
#else
  return __builtin_astype(__builtin_convertvector(x, floatv), uintv);
#endif
#elif WIDTH == 1
  return as_uint(x);
#else
  return __builtin_astype(x, uintv);
#endif
}

/* passing_number - a number in [0, 1) for a ray at a surface, the same wherever it is asked.
 *
 * Surfaces that are passed by chance need a number of their own for every ray and every surface.
 */
INLINE realv passing_number(const pathv *ray, realv distance, intv object, uint stream) {
  uintv bits = mix_bits(hash_of_real(ray->dx) + stream);
  bits = mix_bits(bits ^ hash_of_real(ray->dy));
  bits = mix_bits(bits ^ hash_of_real(ray->ox));
  bits = mix_bits(bits ^ hash_of_real(ray->oy));
  bits = mix_bits(bits ^ hash_of_real(distance));
  bits = mix_bits(bits ^ uint_from_int(object));
  return unit_real(bits);
}

/* visible_share - the share of light that reaches the end of rays through cut-out surfaces. */
INLINE realv visible_share(const shapes_t *shapes, const triangles_t *triangles,
                           const looks_t *looks, const pathv *ray, realv most, maskv active) {
  realv share = active ? (realv)1 : (realv)0;
  shape_hitv hit;
  first_hit(shapes, ray, (realv)0, active, &hit);
  for (int pass = 0; pass < MOST_PASSES; ++pass) {
    active = active & (hit.distance < most) & (share > 0);
    if (!any_lane(active)) break;
    hit.object = select_int(active, hit.object, (intv)(-1));
    maskv is_additive;
    realv opacity = opacity_at(shapes, triangles, looks, ray, &hit, &is_additive);
    share *= (active & !is_additive) ? 1 - opacity : (realv)1;
    realv passed = hit.distance;
    hit_behind(shapes, ray, passed, hit.object, active, &hit);
  }
  return active ? (realv)0 : share;
}

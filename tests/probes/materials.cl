/* materials.cl - the eval, pdf and sample of one material, for tests/test_materials.py. */
#include "lib/materials/materials.cl"

INLINE void closure(constant real *p, closurev *c) {
  c->kind = (int)p[0];
  c->is_polished = p[1] == 0;
  c->alpha = larger((realv)p[1], (realv)R(1e-3));
  c->index = p[2];
  c->inner = p[3];
  for (int k = 0; k < 4; ++k) c->albedo.w[k] = p[4 + k], c->other.w[k] = p[8 + k];
}

INLINE void direction(constant real *p, vec3v *wo) {
  wo->x = p[12], wo->y = p[13], wo->z = p[14];
}

/* x: planes u, v, choice; out: planes of wi, density, weights */
kernel void probe_sample(constant real *p, global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  closurev c;
  vec3v wo, wi;
  closure(p, &c);
  direction(p, &wo);
  colourv weight;
  realv pdf = material_sample(&c, &wo, load_lanes(x, g), load_lanes(x + n, g),
                              load_lanes(x + 2 * n, g), &wi, &weight);
  store_lanes(wi.x, out, g);
  store_lanes(wi.y, out + n, g);
  store_lanes(wi.z, out + 2 * n, g);
  store_lanes(pdf, out + 3 * n, g);
  for (int k = 0; k < 4; ++k) store_lanes(weight.w[k], out + (4 + k) * n, g);
}

/* x: planes of wi; out: planes of density, values */
kernel void probe_eval(constant real *p, global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  closurev c;
  vec3v wo, wi;
  closure(p, &c);
  direction(p, &wo);
  wi.x = load_lanes(x, g), wi.y = load_lanes(x + n, g), wi.z = load_lanes(x + 2 * n, g);
  colourv value;
  material_eval(&c, &wo, &wi, &value);
  store_lanes(material_pdf(&c, &wo, &wi), out, g);
  for (int k = 0; k < 4; ++k) store_lanes(value.w[k], out + (1 + k) * n, g);
}

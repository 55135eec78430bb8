/* diffuse.cl - Lambert's law, reflected and, for thin sheets, transmitted.
 */
#include "lib/materials/closure.cl"

/* diffuse_share - the chance that a path is reflected and not transmitted. */
INLINE realv diffuse_share(const closurev *c) {
#if HAS_TRANSLUCENT
  realv reflected = largest4(&c->albedo), passed = largest4(&c->other);
  realv sum = reflected + passed;
  return sum > 0 ? reflected / larger(sum, (realv)R(1e-30)) : (realv)1;
#else
  return (realv)1;
#endif
}

INLINE void diffuse_eval(const closurev *c, const vec3v *wo, const vec3v *wi, colourv *value) {
  realv scale = magnitude(wi->z) * R(0.31830988618379067154);
  for (int k = 0; k < 4; ++k) {
#if HAS_TRANSLUCENT
    value->w[k] = (wi->z > 0 ? c->albedo.w[k] : c->other.w[k]) * scale;
#else
    value->w[k] = wi->z > 0 ? c->albedo.w[k] * scale : (realv)0;
#endif
  }
}

INLINE realv diffuse_pdf(const closurev *c, const vec3v *wo, const vec3v *wi) {
  realv share = diffuse_share(c);
  return magnitude(wi->z) * R(0.31830988618379067154) * (wi->z > 0 ? share : 1 - share);
}

INLINE realv diffuse_sample(const closurev *c, const vec3v *wo, realv u, realv v, realv choice,
                            vec3v *wi, colourv *weight) {
  cosine_direction(u, v, wi);
  realv cosine = wi->z;
#if HAS_TRANSLUCENT
  realv share = diffuse_share(c);
  maskv reflected = choice < share;
  for (int k = 0; k < 4; ++k)
    weight->w[k] = (reflected ? c->albedo.w[k] : c->other.w[k]) / (reflected ? share : 1 - share);
  wi->z = reflected ? wi->z : -wi->z;
  return cosine * R(0.31830988618379067154) * (reflected ? share : 1 - share);
#else
  *weight = c->albedo;
  return cosine * R(0.31830988618379067154);
#endif
}

/* mirror.cl - mirrors and metals, polished or rough.
 */
#include "lib/materials/closure.cl"
#include "lib/materials/microfacet.cl"

#if HAS_CONDUCTORS
/* conductor_fresnel - reflectance of unpolarised light from air at a metal n + i k.
 *
 * Source: Born & Wolf, Principles of Optics, 14.2; written with squares only.
 */
INLINE realv conductor_fresnel(realv cosine, realv n, realv k) {
  realv c2 = cosine * cosine, s2 = 1 - c2, n2 = n * n, k2 = k * k;
  realv t0 = n2 - k2 - s2;
  realv a2b2 = square_root(mul_add(t0, t0, 4 * n2 * k2));
  realv t1 = a2b2 + c2;
  realv t2 = 2 * cosine * square_root(larger(R(0.5) * (a2b2 + t0), (realv)0));
  realv across = (t1 - t2) / (t1 + t2);
  realv t3 = mul_add(c2, a2b2, s2 * s2), t4 = t2 * s2;
  realv along = across * (t3 - t4) / (t3 + t4);
  return R(0.5) * (across + along);
}
#endif

/* mirror_reflectance - reflectance of a microfacet, `cosine` from its normal. */
INLINE void mirror_reflectance(const closurev *c, realv cosine, colourv *value) {
#if HAS_CONDUCTORS
  if (c->kind == SUBSTANCE_CONDUCTOR) {
    for (int k = 0; k < 4; ++k)
      value->w[k] = conductor_fresnel(cosine, c->albedo.w[k], c->other.w[k]);
    return;
  }
#endif
  *value = c->albedo;
}

INLINE void mirror_eval(const closurev *c, const vec3v *wo, const vec3v *wi, colourv *value) {
  vec3v h;
  middle_vector(wo, wi, &h);
  mirror_reflectance(c, smaller(dot3(wo->x, wo->y, wo->z, h.x, h.y, h.z), (realv)1), value);
  realv scale = c->is_polished ? (realv)0 : ggx_reflection(wo, wi, &h, c->alpha);
  for (int k = 0; k < 4; ++k) value->w[k] *= scale;
}

INLINE realv mirror_pdf(const closurev *c, const vec3v *wo, const vec3v *wi) {
  if (c->is_polished) return (realv)0;
  vec3v h;
  middle_vector(wo, wi, &h);
  return ggx_reflection_pdf(wo, wi, &h, c->alpha);
}

INLINE realv mirror_sample(const closurev *c, const vec3v *wo, realv u, realv v, realv choice,
                           vec3v *wi, colourv *weight) {
  if (c->is_polished) {
    wi->x = -wo->x, wi->y = -wo->y, wi->z = wo->z;
    mirror_reflectance(c, wo->z, weight);
    return (realv)-1;
  }
  vec3v h;
  ggx_sample(wo, c->alpha, u, v, &h);
  mirror_in(wo, &h, wi);
  mirror_reflectance(c, smaller(dot3(wo->x, wo->y, wo->z, h.x, h.y, h.z), (realv)1), weight);
  realv shadow = ggx_shadow(wo, c->alpha);
  realv scale = (1 + shadow) / (1 + shadow + ggx_shadow(wi, c->alpha));
  scale = wi->z > 0 ? scale : (realv)0;
  for (int k = 0; k < 4; ++k) weight->w[k] *= scale;
  return ggx_reflection_pdf(wo, wi, &h, c->alpha);
}

/* coated.cl - a matt surface under a clear coat.
 *
 * What enters the coat is scattered, sent back down by the coat as often as its inner reflectance
 * says, and leaves: f = (1 - F_o) (1 - F_i) rho / (pi n^2 (1 - rho inner)).
 * Source: the "plastic" of Mitsuba with its non-linear colour shift (Jakob et al.).
 */
#include "lib/materials/closure.cl"
#include "lib/materials/microfacet.cl"

/* coated_share - the chance of reflection at the coat, from the light that each part sends back. */
INLINE realv coated_share(const closurev *c, realv fresnel) {
  realv below = (1 - fresnel) * largest4(&c->albedo);
  return fresnel / larger(fresnel + below, (realv)R(1e-30));
}

/* coated_below - light from under the coat. */
INLINE void coated_below(const closurev *c, realv fresnel_o, const vec3v *wi, colourv *value) {
  realv refracted;
  realv cosine = smaller(larger(wi->z, (realv)0), (realv)1);
  realv passed = (1 - fresnel_o) * (1 - dielectric_fresnel(cosine, c->index, &refracted));
  realv scale = passed * cosine * R(0.31830988618379067154) / (c->index * c->index);
  for (int k = 0; k < 4; ++k)
    value->w[k] = scale * c->albedo.w[k] / mul_add(-c->albedo.w[k], c->inner, (realv)1);
}

INLINE void coated_eval(const closurev *c, const vec3v *wo, const vec3v *wi, colourv *value) {
  realv refracted;
  realv fresnel = dielectric_fresnel(smaller(wo->z, (realv)1), c->index, &refracted);
  coated_below(c, fresnel, wi, value);
  if (c->is_polished) return;
  vec3v h;
  middle_vector(wo, wi, &h);
  realv o = smaller(dot3(wo->x, wo->y, wo->z, h.x, h.y, h.z), (realv)1);
  realv gloss = dielectric_fresnel(o, c->index, &refracted) * ggx_reflection(wo, wi, &h, c->alpha);
  for (int k = 0; k < 4; ++k) value->w[k] += gloss;
}

INLINE realv coated_pdf(const closurev *c, const vec3v *wo, const vec3v *wi) {
  realv refracted;
  realv fresnel = dielectric_fresnel(smaller(wo->z, (realv)1), c->index, &refracted);
  realv share = coated_share(c, fresnel);
  realv pdf = (1 - share) * larger(wi->z, (realv)0) * R(0.31830988618379067154);
  if (c->is_polished) return pdf;
  vec3v h;
  middle_vector(wo, wi, &h);
  return mul_add(share, ggx_reflection_pdf(wo, wi, &h, c->alpha), pdf);
}

INLINE realv coated_sample(const closurev *c, const vec3v *wo, realv u, realv v, realv choice,
                           vec3v *wi, colourv *weight) {
  realv refracted;
  realv fresnel = dielectric_fresnel(smaller(wo->z, (realv)1), c->index, &refracted);
  realv share = coated_share(c, fresnel);
  maskv gloss = choice < share;
  cosine_direction(u, v, wi);
  vec3v other;
  if (c->is_polished) {
    other.x = -wo->x, other.y = -wo->y, other.z = wo->z;
  } else {
    vec3v h;
    ggx_sample(wo, c->alpha, u, v, &h);
    mirror_in(wo, &h, &other);
  }
  wi->x = gloss ? other.x : wi->x;
  wi->y = gloss ? other.y : wi->y;
  wi->z = gloss ? other.z : wi->z;
  realv pdf = coated_pdf(c, wo, wi);
  coated_eval(c, wo, wi, weight);
  realv scale = pdf > 0 ? 1 / larger(pdf, (realv)R(1e-30)) : (realv)0;
  realv mirrored = fresnel / larger(share, (realv)R(1e-30));
  for (int k = 0; k < 4; ++k)
    weight->w[k] = gloss & (maskv)(c->is_polished ? -1 : 0) ? mirrored : weight->w[k] * scale;
  pdf = wi->z > 0 ? pdf : (realv)0;
  return gloss & (maskv)(c->is_polished ? -1 : 0) ? (realv)-1 : pdf;
}

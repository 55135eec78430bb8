/* dielectric.cl - the surface of a clear body, polished or rough.
 *
 * Radiance is divided by the square of the index it enters a medium with, so that radiance over
 * index squared is kept along a path.
 * Source: Walter et al. (2007), "Microfacet models for refraction through rough surfaces", EGSR.
 */
#include "lib/materials/closure.cl"
#include "lib/materials/microfacet.cl"

/* dielectric_half - the microfacet that mirrors or refracts wi to wo, on the viewer's side. */
INLINE void dielectric_half(const closurev *c, const vec3v *wo, const vec3v *wi, vec3v *h) {
  realv scale = wi->z > 0 ? (realv)1 : c->index;
  realv x = mul_add(scale, wi->x, wo->x), y = mul_add(scale, wi->y, wo->y),
        z = mul_add(scale, wi->z, wo->z);
  realv inverse = 1 / square_root(larger(dot3(x, y, z, x, y, z), (realv)R(1e-30)));
  inverse = z < 0 ? -inverse : inverse;
  h->x = x * inverse, h->y = y * inverse, h->z = z * inverse;
}

/* dielectric_terms - eval (alike for all wavelengths) and pdf of a rough surface. */
INLINE realv dielectric_terms(const closurev *c, const vec3v *wo, const vec3v *wi, realv *pdf) {
  vec3v h;
  dielectric_half(c, wo, wi, &h);
  realv o = dot3(wo->x, wo->y, wo->z, h.x, h.y, h.z);
  realv i = dot3(wi->x, wi->y, wi->z, h.x, h.y, h.z);
  maskv reflected = wi->z > 0;
  /* Both directions must lie on the same sides of the microfacet and of the surface. */
  maskv possible = (o > 0) & (reflected ? i > 0 : i < 0);
  realv refracted;
  realv fresnel = dielectric_fresnel(smaller(larger(o, (realv)0), (realv)1), c->index, &refracted);
  realv shadow_o = ggx_shadow(wo, c->alpha), shadow_i = ggx_shadow(wi, c->alpha);
  realv density = ggx_density(&h, c->alpha);
  realv visible = density / (wo->z * (1 + shadow_o));
  realv both = density / (wo->z * (1 + shadow_o + shadow_i));
  realv bent = i + o / c->index;
  realv spread = magnitude(i) / larger(bent * bent, (realv)R(1e-30));
  realv share = reflected ? fresnel * R(0.25) : (1 - fresnel) * spread * o;
  *pdf = possible ? visible * share : (realv)0;
  realv value = both * share;
  return possible ? (reflected ? value : value / (c->index * c->index)) : (realv)0;
}

INLINE void dielectric_eval(const closurev *c, const vec3v *wo, const vec3v *wi, colourv *value) {
  realv pdf = 0;
  realv all = c->is_polished ? (realv)0 : dielectric_terms(c, wo, wi, &pdf);
  for (int k = 0; k < 4; ++k) value->w[k] = all;
}

INLINE realv dielectric_pdf(const closurev *c, const vec3v *wo, const vec3v *wi) {
  realv pdf = 0;
  if (!c->is_polished) dielectric_terms(c, wo, wi, &pdf);
  return pdf;
}

INLINE realv dielectric_sample(const closurev *c, const vec3v *wo, realv u, realv v, realv choice,
                               vec3v *wi, colourv *weight) {
  vec3v h = {(realv)0, (realv)0, (realv)1};
  if (!c->is_polished) ggx_sample(wo, c->alpha, u, v, &h);
  realv o = smaller(larger(dot3(wo->x, wo->y, wo->z, h.x, h.y, h.z), (realv)0), (realv)1);
  realv refracted;
  realv fresnel = dielectric_fresnel(o, c->index, &refracted);
  maskv reflected = choice < fresnel;
  vec3v mirrored;
  mirror_in(wo, &h, &mirrored);
  realv inverse = 1 / c->index, along = mul_add(o, inverse, -refracted);
  wi->x = reflected ? mirrored.x : mul_add(along, h.x, -wo->x * inverse);
  wi->y = reflected ? mirrored.y : mul_add(along, h.y, -wo->y * inverse);
  wi->z = reflected ? mirrored.z : mul_add(along, h.z, -wo->z * inverse);
  realv scale = reflected ? (realv)1 : inverse * inverse;
  realv density = -1;
  if (!c->is_polished) {
    realv shadow = ggx_shadow(wo, c->alpha);
    scale *= (1 + shadow) / (1 + shadow + ggx_shadow(wi, c->alpha));
    maskv lost = reflected ? wi->z <= 0 : wi->z >= 0;
    dielectric_terms(c, wo, wi, &density);
    scale = lost ? (realv)0 : scale;
    density = lost ? (realv)0 : density;
  }
  for (int k = 0; k < 4; ++k) weight->w[k] = scale;
  return density;
}

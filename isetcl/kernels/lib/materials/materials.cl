/* materials.cl - all materials behind one eval, pdf and sample. */
#include "lib/materials/closure.cl"
#include "lib/materials/diffuse.cl"
#include "lib/materials/microfacet.cl"
#if HAS_MIRRORS
#include "lib/materials/mirror.cl"
#endif
#if HAS_DIELECTRICS
#include "lib/materials/dielectric.cl"
#endif
#if HAS_COATED
#include "lib/materials/coated.cl"
#endif

INLINE void material_eval(const closurev *c, const vec3v *wo, const vec3v *wi, colourv *value) {
#if HAS_MIRRORS
  if (c->kind == SUBSTANCE_MIRROR || c->kind == SUBSTANCE_CONDUCTOR)
    return mirror_eval(c, wo, wi, value);
#endif
#if HAS_DIELECTRICS
  if (c->kind == SUBSTANCE_DIELECTRIC) return dielectric_eval(c, wo, wi, value);
#endif
#if HAS_COATED
  if (c->kind == SUBSTANCE_COATED) return coated_eval(c, wo, wi, value);
#endif
  diffuse_eval(c, wo, wi, value);
}

INLINE realv material_pdf(const closurev *c, const vec3v *wo, const vec3v *wi) {
#if HAS_MIRRORS
  if (c->kind == SUBSTANCE_MIRROR || c->kind == SUBSTANCE_CONDUCTOR) return mirror_pdf(c, wo, wi);
#endif
#if HAS_DIELECTRICS
  if (c->kind == SUBSTANCE_DIELECTRIC) return dielectric_pdf(c, wo, wi);
#endif
#if HAS_COATED
  if (c->kind == SUBSTANCE_COATED) return coated_pdf(c, wo, wi);
#endif
  return diffuse_pdf(c, wo, wi);
}

INLINE realv material_sample(const closurev *c, const vec3v *wo, realv u, realv v, realv choice,
                             vec3v *wi, colourv *weight) {
#if HAS_MIRRORS
  if (c->kind == SUBSTANCE_MIRROR || c->kind == SUBSTANCE_CONDUCTOR)
    return mirror_sample(c, wo, u, v, choice, wi, weight);
#endif
#if HAS_DIELECTRICS
  if (c->kind == SUBSTANCE_DIELECTRIC) return dielectric_sample(c, wo, u, v, choice, wi, weight);
#endif
#if HAS_COATED
  if (c->kind == SUBSTANCE_COATED) return coated_sample(c, wo, u, v, choice, wi, weight);
#endif
  return diffuse_sample(c, wo, u, v, choice, wi, weight);
}

/* material_scatters_to_lights - whether a direction towards a light can carry any light at all. */
INLINE int material_scatters_to_lights(const closurev *c) {
  if (c->kind == SUBSTANCE_DIFFUSE || c->kind == SUBSTANCE_COATED) return 1;
  return !c->is_polished;
}

/* material_transmits - whether light from behind the surface is seen. */
INLINE int material_transmits(const closurev *c) {
#if HAS_TRANSLUCENT || HAS_DIELECTRICS
  return c->kind == SUBSTANCE_DIELECTRIC || c->kind == SUBSTANCE_DIFFUSE;
#else
  return 0;
#endif
}

/* microfacet.cl - rough surfaces made of tiny mirrors: the GGX distribution.
 *
 * Directions are in the frame of the surface; those of the viewer have z > 0. `alpha` is the width.
 */
#include "lib/frame.cl"
#include "lib/turn.cl"

/* ggx_density - density of microfacet normals h per solid angle, over cos h.
 *
 * Source: Trowbridge & Reitz (1975); Walter et al. (2007), EGSR, equation 33.
 */
INLINE realv ggx_density(const vec3v *h, realv alpha) {
  realv a2 = alpha * alpha;
  realv e = mul_add(h->x, h->x, h->y * h->y) / a2 + h->z * h->z;
  return R(0.31830988618379067154) / (a2 * e * e);
}

/* ggx_shadow - Smith's Lambda of a direction, 0 where nothing is hidden. */
INLINE realv ggx_shadow(const vec3v *w, realv alpha) {
  realv tangent2 = mul_add(w->x, w->x, w->y * w->y) / (w->z * w->z);
  return R(0.5) * (square_root(mul_add(alpha * alpha, tangent2, (realv)1)) - 1);
}

/* ggx_visible - density of the microfacets h that the viewer sees, per solid angle.
 *
 * Source: Heitz (2014), "Understanding the masking-shadowing function", JCGT 3(2), equation 16.
 */
INLINE realv ggx_visible(const vec3v *wo, const vec3v *h, realv alpha) {
  realv cosine = larger(dot3(wo->x, wo->y, wo->z, h->x, h->y, h->z), (realv)0);
  return ggx_density(h, alpha) * cosine / ((1 + ggx_shadow(wo, alpha)) * wo->z);
}

/* ggx_sample - a microfacet that the viewer sees, with density ggx_visible.
 *
 * Source: Dupuy & Benyoub (2023), "Sampling visible GGX normals with spherical caps", HPG.
 */
INLINE void ggx_sample(const vec3v *wo, realv alpha, realv u, realv v, vec3v *h) {
  realv x = alpha * wo->x, y = alpha * wo->y, z = wo->z;
  realv inverse = 1 / square_root(dot3(x, y, z, x, y, z));
  x *= inverse, y *= inverse, z *= inverse;
  realv height = mul_add(1 - v, 1 + z, -z);
  realv radius = square_root(larger(mul_add(-height, height, (realv)1), (realv)0));
  realv sine, cosine;
  sine_cosine_turn(u, &sine, &cosine);
  x = alpha * mul_add(radius, cosine, x);
  y = alpha * mul_add(radius, sine, y);
  z = larger(height + z, (realv)R(1e-12));
  inverse = 1 / square_root(dot3(x, y, z, x, y, z));
  h->x = x * inverse, h->y = y * inverse, h->z = z * inverse;
}

/* middle_vector - the microfacet that mirrors wi to wo. */
INLINE void middle_vector(const vec3v *wo, const vec3v *wi, vec3v *h) {
  realv x = wo->x + wi->x, y = wo->y + wi->y, z = wo->z + wi->z;
  realv length2 = dot3(x, y, z, x, y, z);
  realv inverse = 1 / square_root(larger(length2, (realv)R(1e-30)));
  h->x = x * inverse, h->y = y * inverse, h->z = z * inverse;
}

/* mirror_in - wo mirrored in a microfacet. */
INLINE void mirror_in(const vec3v *wo, const vec3v *h, vec3v *wi) {
  realv twice = 2 * dot3(wo->x, wo->y, wo->z, h->x, h->y, h->z);
  wi->x = mul_add(twice, h->x, -wo->x);
  wi->y = mul_add(twice, h->y, -wo->y);
  wi->z = mul_add(twice, h->z, -wo->z);
}

/* ggx_reflection - D G2 / (4 cos_o), which times Fresnel's reflectance is the BRDF times cos_i. */
INLINE realv ggx_reflection(const vec3v *wo, const vec3v *wi, const vec3v *h, realv alpha) {
  realv visible = 1 / (1 + ggx_shadow(wo, alpha) + ggx_shadow(wi, alpha));
  return wi->z > 0 ? ggx_density(h, alpha) * visible / (4 * wo->z) : (realv)0;
}

/* ggx_reflection_pdf - density per solid angle of mirroring in a microfacet that is seen. */
INLINE realv ggx_reflection_pdf(const vec3v *wo, const vec3v *wi, const vec3v *h, realv alpha) {
  realv cosine = larger(dot3(wo->x, wo->y, wo->z, h->x, h->y, h->z), (realv)R(1e-12));
  return wi->z > 0 ? ggx_visible(wo, h, alpha) / (4 * cosine) : (realv)0;
}

/* dielectric_fresnel - reflectance of unpolarised light between clear media.
 *
 * cosine   of the angle of incidence, >= 0
 * index    of the far side over the near side
 * refracted out: cosine of the angle of refraction; 0 at total reflection
 */
INLINE realv dielectric_fresnel(realv cosine, realv index, realv *refracted) {
  realv sine2 = mul_add(-cosine, cosine, (realv)1) / (index * index);
  maskv total = sine2 >= 1;
  realv t = square_root(total ? (realv)0 : 1 - sine2);
  *refracted = t;
  realv along = mul_add(index, cosine, -t) / mul_add(index, cosine, t);
  realv across = mul_add(-index, t, cosine) / mul_add(index, t, cosine);
  realv reflectance = R(0.5) * mul_add(along, along, across * across);
  return total ? (realv)1 : reflectance;
}

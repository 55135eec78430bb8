/* gradient.cl - rays through lenses whose index changes from place to place. */
#include "lib/crossing.cl"
#include "lib/steps.cl"
#if HAS_GRADIENTS

/* GRADIENT_NEAR - how far from a surface the last straight step may begin, in units of T, mm.
 * Straight it is wrong by 0.03 of the square of that.
 */
#if DOUBLE_PRECISION
#define GRADIENT_NEAR 1e-4
#else
#define GRADIENT_NEAR 1e-2f
#endif

/* approach_element - as cross_element, for rays that are almost there. */
INLINE maskv approach_element(rayv *ray, constant element_t *element,
                              global const real *eye_table, real sense, int far_side,
                              crossingv *at) {
#if HAS_FORMS
  return cross_element(ray, element, eye_table, sense, far_side, at);
#else
  conic_approach(ray, element, sense, at);
  return -1;
#endif
}

/* integrate - rays gone a length of t, mm, in equal steps; returns the optical path length, mm. */
INLINE realv integrate(rayv *ray, global const real *profile, realv way, int steps) {
  const realv h = steps == 1 ? way : way * (R(1.0) / (real)steps);
  realv length = 0;
  to_profile(ray, profile);
  for (int i = 0; i < steps; ++i) length += gradient_step(ray, profile, h);
  from_profile(ray, profile);
  return length;
}

/* cross_gradient - moves rays through the gradient in front of an element onto it.
 *
 * The straight way to the element is the length of t to integrate; what is left of the way is gone
 * the same way with fewer steps, then in a short step, then straight.
 *
 * As cross_element. A ray that does not get there becomes NaN. at->path is the optical path length
 * over the square of the index at the element's vertex (HAS_OPL).
 */
INLINE maskv cross_gradient(rayv *ray, constant element_t *element, global const real *eye_table,
                            real sense, int far_side, crossingv *at) {
  global const real *profile = eye_table + element->gradient_incident;
  rayv straight = *ray;
  maskv met = -1;
  if (HAS_FORMS || element->curvature != 0)
    met = cross_element(&straight, element, eye_table, sense, far_side, at);
  else
    at->path = -ray->z / ray->tz;
  /* A ray may meet the element though its straight way does not. */
  realv way = is_number(at->path) ? at->path : -ray->z / ray->tz;
  realv length = integrate(ray, profile, way, element->gradient_steps);
  for (int round = 0; round < element->gradient_rounds; ++round) {
    straight = *ray;
    met = met & approach_element(&straight, element, eye_table, sense, far_side, at);
    length += integrate(ray, profile, at->path, element->gradient_landing);
  }
  rayv force = straight = *ray;
  met = met & approach_element(&straight, element, eye_table, sense, far_side, at);
  to_profile(ray, profile);
  realv n2;
  length += short_step(ray, profile, at->path, &force, &n2);
  from_profile(ray, profile);
  from_profile(&force, profile);
  met = met & approach_element(ray, element, eye_table, sense, far_side, at);
  ray->tx = mul_add(at->path, force.tx, ray->tx);
  ray->ty = mul_add(at->path, force.ty, ray->ty);
  ray->tz = mul_add(at->path, force.tz, ray->tz);
  maskv landed = magnitude(at->path) <= GRADIENT_NEAR;
  ray->x = landed ? ray->x : (realv)NAN;
#if HAS_OPL
  at->path = mul_add(at->path, n2, length) * element->inverse_n2;
#endif
  return met;
}

/* squared_index_after - n^2 of the medium behind a surface at points on it. */
INLINE realv squared_index_after(const rayv *ray, constant element_t *element,
                                 global const real *eye_table) {
  if (element->gradient_transmitted < 0) return element->n2_transmitted;
  global const real *profile = eye_table + element->gradient_transmitted;
  rayv there = *ray;
  to_profile(&there, profile);
  realv fx, fy, fz;
  return index_force(profile, there.x, there.y, there.z, &fx, &fy, &fz);
}
#endif

/* arrive - as cross_element, through whatever medium lies in front of the element. */
INLINE maskv arrive(rayv *ray, constant element_t *element, global const real *eye_table,
                    real sense, int far_side, crossingv *at) {
#if HAS_GRADIENTS
  if (element->gradient_incident >= 0)
    return cross_gradient(ray, element, eye_table, sense, far_side, at);
#endif
  return cross_element(ray, element, eye_table, sense, far_side, at);
}

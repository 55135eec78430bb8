/* conic.cl - rays against conics of revolution about the axis of their vertex.
 *
 * c (x^2 + y^2 + (1 + k) z^2) - 2 z = 0.
 */
#include "lib/ray.cl"

/* conic_intersect - moves rays to a conic, crossed in the direction of travel.
 *
 * ray       rays at their closest approach to the vertex, moved to the surface
 * s         surface constants for this direction of travel
 * sense, far_side   as in crossing_root
 * at out    path (added to) and q
 *
 * Returns the rays on the near side, or all if the far side is included. A ray that misses becomes
 * NaN.
 */
INLINE maskv conic_intersect(rayv *ray, constant element_t *s, real sense, int far_side,
                             crossingv *at) {
#if HAS_GRADIENTS
  /* |T| is the index where the ray is, not at the vertex. */
  const realv curvature_times_n2 = s->curvature * squared_length(ray);
#else
  const real curvature_times_n2 = s->curvature_times_n2;
#endif
#if HAS_CONICS
  realv kz = s->kappa * ray->z;
  realv a = mul_add((realv)s->curvature_times_conic * ray->tz, ray->tz,
                    (realv)curvature_times_n2);
#else
  realv kz = ray->z;
  realv a = curvature_times_n2;
#endif
  realv across = mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, kz * ray->tz));
  realv f = mul_add((realv)-s->curvature, across, ray->tz);
  realv g = mul_add((realv)s->curvature,
                    mul_add(ray->x, ray->x, mul_add(ray->y, ray->y, kz * ray->z)),
                    R(-2.0) * ray->z);
  maskv near_side;
  const realv step = crossing_root(f, g, a, sense, far_side, &at->q, &near_side);
  advance(ray, step);
  at->path += step;
  return near_side;
}

/* conic_slope - the slope g of a conic at a point on it, and |g|^2. */
INLINE void conic_slope(const rayv *ray, constant element_t *s, crossingv *at) {
  at->gx = -s->curvature * ray->x;
  at->gy = -s->curvature * ray->y;
  at->gz = mul_add((realv)-s->curvature_times_kappa, ray->z, (realv)1);
#if HAS_CONICS
  at->g2 = mul_add(at->gx, at->gx, mul_add(at->gy, at->gy, at->gz * at->gz));
#else
  at->g2 = 1;
#endif
}

#if HAS_GRADIENTS
/* conic_approach - moves rays that are almost on a conic onto it: one step of Newton's method.
 *
 * As conic_intersect, whose square root it spares; q is that of before. A ray that crosses against
 * its direction of travel becomes NaN.
 */
INLINE void conic_approach(rayv *ray, constant element_t *s, real sense, crossingv *at) {
  realv kz = ray->z;
#if HAS_CONICS
  kz *= s->kappa;
#endif
  realv value = mul_add((realv)s->curvature,
                        mul_add(ray->x, ray->x, mul_add(ray->y, ray->y, kz * ray->z)),
                        R(-2.0) * ray->z);
  realv across = mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, kz * ray->tz));
  at->q = mul_add((realv)-s->curvature, across, ray->tz);
  at->path = R(0.5) * value / (sense * at->q > 0 ? at->q : (realv)NAN);
  advance(ray, at->path);
  at->ax = ray->x;
  at->ay = ray->y;
}
#endif

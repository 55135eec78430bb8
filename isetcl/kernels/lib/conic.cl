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
#if HAS_CONICS
  realv kz = s->kappa * ray->z;
  realv a = mul_add((realv)s->curvature_times_conic * ray->tz, ray->tz,
                    (realv)s->curvature_times_n2);
#else
  realv kz = ray->z;
  realv a = s->curvature_times_n2;
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

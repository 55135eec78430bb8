/* conic.cl - rays against conics of revolution. */
#include "lib/ray.cl"

/* conic_intersect - moves rays to a conic of revolution, crossed in the direction of travel.
 *
 * In the frame of the vertex:  c (x^2 + y^2 + (1 + k) z^2) - 2 z = 0.
 * Moves to the point of closest approach first, then takes the root whose crossing has
 * g . T = sense sqrt(F^2 - A G); the discriminant is formed with Kahan's difference of products.
 * On the near side (F q >= 0, nearly all rays of nearly all eyes) the root is G / (F + q), which
 * does not cancel and makes A = 0 (plane, axis-parallel ray on a paraboloid) no special case; on
 * the far side it is (F - q) / A. A ray that misses becomes NaN.
 *
 * ray       rays, moved to the surface; z is relative to the vertex before and after
 * s         surface constants for this direction of travel
 * sense     +1 towards the retina, -1 towards the scene
 * far_side  1: take the far-side root where it applies; 0: leave it out. A constant
 * at out    path and q
 *
 * Returns the rays on the near side, or all if the far side is included.
 * Source: Feder 1951, J Opt Soc Am 41:630 (roots); W. Kahan (difference of products).
 */
INLINE maskv conic_intersect(rayv *ray, constant element_t *s, real sense, int far_side,
                             crossingv *at) {
  realv approach =
      -s->inverse_n2 * mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, ray->z * ray->tz));
  realv x = mul_add(approach, ray->tx, ray->x);
  realv y = mul_add(approach, ray->ty, ray->y);
  realv z = mul_add(approach, ray->tz, ray->z);
#if HAS_GRADIENTS
  /* |T| is the index at the ray, not at the vertex. */
  const realv curvature_times_n2 = s->curvature * squared_length(ray);
#else
  const real curvature_times_n2 = s->curvature_times_n2;
#endif
#if HAS_CONICS
  realv kz = s->kappa * z;
  realv a = mul_add((realv)s->curvature_times_conic * ray->tz, ray->tz,
                    (realv)curvature_times_n2);
#else
  realv kz = z;
  realv a = curvature_times_n2;
#endif
  realv across = mul_add(x, ray->tx, mul_add(y, ray->ty, kz * ray->tz));
  realv f = mul_add((realv)-s->curvature, across, ray->tz);
  realv g = mul_add((realv)s->curvature, mul_add(x, x, mul_add(y, y, kz * z)), R(-2.0) * z);
  realv product = a * g;
  realv rounding = mul_add(-a, g, product);
  realv discriminant = mul_add(f, f, -product);
  discriminant += rounding;
  const realv q = sense * square_root(discriminant);
  realv numerator = g;
  realv denominator = f + q;
  maskv near_side = sense * f >= 0;
  if (far_side) {
    numerator = near_side ? g : f - q;
    denominator = near_side ? denominator : a;
    /* A ray in the surface touches it where it is; 0 / 0 elsewhere is a miss, as x / 0 is. */
    denominator = (numerator == 0) ? (realv)1 : denominator;
    near_side = 1;
  }
  realv step = numerator / denominator;
  ray->x = mul_add(step, ray->tx, x);
  ray->y = mul_add(step, ray->ty, y);
  ray->z = mul_add(step, ray->tz, z);
  at->path = approach + step;
  at->q = q;
  return near_side;
}

/* conic_slope - the slope g of a conic of revolution at a point on it, and |g|^2. */
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
  ray->x = mul_add(at->path, ray->tx, ray->x);
  ray->y = mul_add(at->path, ray->ty, ray->y);
  ray->z = mul_add(at->path, ray->tz, ray->z);
  at->ax = ray->x;
  at->ay = ray->y;
}
#endif

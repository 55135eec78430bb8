/* refraction.cl - rays against the conic surfaces of an eye.
 *
 * A direction T is scaled to the index of the medium, |T| = n. Then neither the length of the
 * surface gradient nor a division by the index is needed at a refraction.
 */
#include "lib/real.cl"

/* rayv - WIDTH rays: a point (mm) and a direction of length n. */
typedef struct {
  realv x, y, z;
  realv tx, ty, tz;
} rayv;

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
 * q out     g . T, the sine-free part of Snell's law
 * path out  path from the old point to the new one, in units of T
 *
 * Returns the rays on the near side, or all if the far side is included.
 * Source: Feder 1951, J Opt Soc Am 41:630 (roots); W. Kahan (difference of products).

 */
INLINE maskv conic_intersect(rayv *ray, constant element_t *s, real sense, int far_side, realv *q,
                             realv *path) {
  realv approach =
      -s->inverse_n2 * mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, ray->z * ray->tz));
  realv x = mul_add(approach, ray->tx, ray->x);
  realv y = mul_add(approach, ray->ty, ray->y);
  realv z = mul_add(approach, ray->tz, ray->z);
#if HAS_CONICS
  realv kz = s->kappa * z;
  realv a = mul_add((realv)s->curvature_times_conic * ray->tz, ray->tz,
                    (realv)s->curvature_times_n2);
#else
  realv kz = z;
  realv a = s->curvature_times_n2;
#endif
  realv across = mul_add(x, ray->tx, mul_add(y, ray->ty, kz * ray->tz));
  realv f = mul_add((realv)-s->curvature, across, ray->tz);
  realv g = mul_add((realv)s->curvature, mul_add(x, x, mul_add(y, y, kz * z)), R(-2.0) * z);
  realv product = a * g;
  realv rounding = mul_add(-a, g, product);
  realv discriminant = mul_add(f, f, -product);
  discriminant += rounding;
  *q = sense * square_root(discriminant);
  realv numerator = g;
  realv denominator = f + *q;
  maskv near_side = sense * f >= 0;
  if (far_side) {
    numerator = near_side ? g : f - *q;
    denominator = near_side ? denominator : a;
    /* A ray in the surface touches it where it is; 0 / 0 elsewhere is a miss, as x / 0 is. */
    denominator = (numerator == 0) ? (realv)1 : denominator;
    near_side = 1;
  }
  realv step = numerator / denominator;
  ray->x = mul_add(step, ray->tx, x);
  ray->y = mul_add(step, ray->ty, y);
  ray->z = mul_add(step, ray->tz, z);
  *path = approach + step;
  return near_side;
}

/* refract - bends rays at a surface by Snell's law; a totally reflected ray becomes NaN.
 *
 * T' = T + Gamma g,  Gamma = sense (n'^2 - n^2) / (sqrt(q^2 + (n'^2 - n^2) |g|^2) + |q|),
 * followed by one Newton step towards |T'| = n'.
 *
 * ray   rays on the surface, z relative to the vertex
 * s     surface constants for this direction of travel
 * q     g . T from conic_intersect
 */
INLINE void refract(rayv *ray, constant element_t *s, real sense, realv q) {
  realv gx = -s->curvature * ray->x;
  realv gy = -s->curvature * ray->y;
  realv gz = mul_add((realv)-s->curvature_times_kappa, ray->z, (realv)1);
#if HAS_CONICS
  realv g2 = mul_add(gx, gx, mul_add(gy, gy, gz * gz));
#else
  realv g2 = 1;
#endif
  realv root = square_root(mul_add((realv)s->index_step, g2, q * q));
  realv bend = sense * s->index_step / (mul_add((realv)sense, q, root) + (realv)R(1e-30));
  realv tx = mul_add(bend, gx, ray->tx);
  realv ty = mul_add(bend, gy, ray->ty);
  realv tz = mul_add(bend, gz, ray->tz);
  realv excess = mul_add(tx, tx, mul_add(ty, ty, mul_add(tz, tz, (realv)-s->n2_transmitted)));
  realv correct = mul_add((realv)s->renormalise, excess, (realv)1);
  ray->tx = tx * correct;
  ray->ty = ty * correct;
  ray->tz = tz * correct;
}

/* plane_cross - moves rays to the vertex plane of an element; z is relative to it.
 *
 * A ray that is parallel to the plane becomes infinite or NaN.
 */
INLINE void plane_cross(rayv *ray, realv *path) {
  *path = -ray->z / ray->tz;
  ray->x = mul_add(*path, ray->tx, ray->x);
  ray->y = mul_add(*path, ray->ty, ray->y);
  ray->z = 0;
}

/* quadric.cl - rays against quadrics through their vertex, cx x^2 + cy y^2 + q z^2 - 2 z = 0.
 *
 * Conics of revolution (cx = cy = c, q = (1 + k) c), ellipsoids with three axes, some biconics; and
 * the surfaces on which the search for all other shapes begins.
 */
#include "lib/ray.cl"

/* quadric_intersect - as conic_intersect. */
INLINE maskv quadric_intersect(rayv *ray, constant element_t *s, real sense, int far_side,
                               crossingv *at) {
  const realv bx = s->curvature_x * ray->x, by = s->curvature * ray->y, bz = s->axial * ray->z;
  const realv f = ray->tz - mul_add(bx, ray->tx, mul_add(by, ray->ty, bz * ray->tz));
  const realv g =
      mul_add(bx, ray->x, mul_add(by, ray->y, mul_add(bz, ray->z, R(-2.0) * ray->z)));
  const realv a = mul_add(s->curvature_x * ray->tx, ray->tx,
                          mul_add(s->curvature * ray->ty, ray->ty, s->axial * ray->tz * ray->tz));
  maskv near_side;
  const realv step = crossing_root(f, g, a, sense, far_side, &at->q, &near_side);
  advance(ray, step);
  at->path += step;
  return near_side;
}

/* quadric_implicit - S = cx x^2 + cy y^2 + q z^2 - 2 z, and g. */
INLINE void quadric_implicit(realv x, realv y, realv z, constant element_t *s, slopev *slope) {
  const realv bx = s->curvature_x * x, by = s->curvature * y, bz = s->axial * z;
  slope->value = mul_add(bx, x, mul_add(by, y, mul_add(bz, z, R(-2.0) * z)));
  slope->gx = -bx;
  slope->gy = -by;
  slope->gz = 1 - bz;
  slope->exists = -1;
}

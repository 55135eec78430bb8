/* crossing.cl - rays to the next element of an eye, whatever it is. */
#include "lib/conic.cl"

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

/* cross_element - moves rays to an element; z is relative to its vertex before and after.
 *
 * eye_table   numbers of the shapes of all elements
 * sense       +1 towards the retina, -1 towards the scene
 * far_side    as in conic_intersect
 * at out      where and how
 *
 * Returns the rays for which that is true; one that misses becomes NaN.
 */
INLINE maskv cross_element(rayv *ray, constant element_t *element,
                           global const real *eye_table, real sense, int far_side,
                           crossingv *at) {
  maskv met = -1;
  if (element->kind == ELEMENT_STOP)
    plane_cross(ray, &at->path);
  else
    met = conic_intersect(ray, element, sense, far_side, at);
  at->ax = ray->x;
  at->ay = ray->y;
  return met;
}

/* is_inside - crossings within the aperture of an element. */
INLINE maskv is_inside(const crossingv *at, constant element_t *element) {
  return mul_add(at->ax, at->ax, at->ay * at->ay) <= element->aperture2;
}

/* eye.cl - rays from the retina out of the eye.
 */
#include "lib/refraction.cl"

/* leave_eye - rays from the vitreous through the eye into the air.
 *
 * ray   origin and direction, z from the corneal vertex before and after
 *
 * Returns the rays that pass the stop and every surface.
 */
INLINE maskv leave_eye(rayv *ray, constant element_t *elements, int n_elements) {
  real vertex_z = 0;
  maskv passed = ray->x == ray->x;
  for (int i = 0; i < n_elements; ++i) {
    constant element_t *element = elements + i;
    ray->z += vertex_z - element->vertex_z;
    vertex_z = element->vertex_z;
    realv q, path;
    if (element->kind == ELEMENT_STOP) {
      plane_cross(ray, &path);
      passed = passed & (mul_add(ray->x, ray->x, ray->y * ray->y) <= element->aperture2);
    } else {
      conic_intersect(ray, element, -1, HAS_FAR_SIDE, &q, &path);
#if HAS_SEMI_DIAMETERS
      passed = passed & (mul_add(ray->x, ray->x, ray->y * ray->y) <= element->aperture2);
#endif
      refract(ray, element, -1, q);
    }
  }
  ray->z += vertex_z;
  return passed & is_number(ray->x + ray->tx);
}

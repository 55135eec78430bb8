/* eye.cl - rays from the retina out of the eye.
 */
#include "lib/gradient.cl"
#include "lib/refraction.cl"

/* leave_eye - rays from the vitreous through the eye into the air.
 *
 * ray         origin and direction, z from the corneal vertex before and after
 * eye_table   numbers of the shapes of all elements
 *
 * Returns the rays that pass the stop and every surface.
 */
INLINE maskv leave_eye(rayv *ray, constant element_t *elements, int n_elements,
                       global const real *eye_table) {
  real vertex_z = 0;
  maskv passed = ray->x == ray->x;
  for (int i = 0; i < n_elements; ++i) {
    constant element_t *element = elements + i;
    ray->z += vertex_z - element->vertex_z;
    vertex_z = element->vertex_z;
    crossingv at;
    arrive(ray, element, eye_table, -1, HAS_FAR_SIDE, &at);
    if (HAS_SEMI_DIAMETERS || element->kind == ELEMENT_STOP)
      passed = passed & is_inside(&at, element);
    if (element->kind == ELEMENT_REFRACT) refract(ray, element, eye_table, -1, &at);
  }
  ray->z += vertex_z;
  return passed & is_number(ray->x + ray->tx);
}

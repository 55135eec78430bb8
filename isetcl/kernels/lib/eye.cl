/* eye.cl - rays from the retina out of the eye.
 */
#include "lib/bend.cl"
#include "lib/crossing.cl"
#include "lib/gradient.cl"
#include "lib/refraction.cl"

/* leave_eye - rays from the vitreous through the eye into the air.
 *
 * ray         origin and direction, z from the corneal vertex before and after
 * eye_table   numbers of the shapes of all elements, and of what bends rays
 * bends       random numbers of what bends them (HAS_DIFFRACTION, HAS_SCATTER)
 *
 * Returns the rays that pass the stop and every surface.
 */
INLINE maskv leave_eye(rayv *ray, constant element_t *elements, int n_elements,
                       global const real *eye_table, const bendsv *bends) {
  real vertex_z = 0;
#if HAS_SCATTER
  int bend = 0;
#endif
  maskv passed = ray->x == ray->x;
  for (int i = 0; i < n_elements; ++i) {
    constant element_t *element = elements + i;
    ray->z += vertex_z - element->vertex_z;
    vertex_z = element->vertex_z;
    crossingv at;
    arrive(ray, element, eye_table, -1, HAS_FAR_SIDE, &at);
    if (HAS_SEMI_DIAMETERS || element->kind == ELEMENT_STOP)
      passed = passed & is_inside(&at, element);
#if HAS_DIFFRACTION
    if (element->kind == ELEMENT_STOP)
      passed = passed & diffract(ray, eye_table + element->bend, &bends->diffraction, -1);
#endif
#if HAS_SCATTER
    if (element->kind == ELEMENT_STOP) bend = element->bend;
#endif
    if (element->is_bending) refract(ray, element, eye_table, -1, &at);
  }
  ray->z += vertex_z;
#if HAS_SCATTER
  scatter(ray, eye_table + bend, &bends->scatter);
#endif
  return passed & is_number(ray->x + ray->tx);
}

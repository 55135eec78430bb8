/* trace_rays.cl - rays through an eye, one bundle, one wavelength. */
#include "lib/gradient.cl"
#include "lib/refraction.cl"

/* pass_all - rays through all elements, on the assumption that none is lost.
 *
 * ray          rays, z from the corneal vertex before and after
 * length out   optical path length, mm (HAS_OPL)
 * elements     elements in the order the rays meet them
 * sense        +1 towards the retina, -1 towards the scene
 *
 * Returns the rays for which that is true; the others hold nonsense.
 */
INLINE maskv pass_all(rayv *ray, realv *length, constant element_t *elements, int n_elements,
                      global const real *eye_table, real sense) {
  real vertex_z = 0;
  maskv passed = ray->x == ray->x;
  for (int i = 0; i < n_elements; ++i) {
    constant element_t *element = elements + i;
    ray->z += vertex_z - element->vertex_z;
    vertex_z = element->vertex_z;
    crossingv at;
    passed = passed & arrive(ray, element, eye_table, sense, 0, &at);
    passed = passed & is_inside(&at, element);
#if HAS_OPL
    *length = mul_add(at.path, (realv)element->n2_incident, *length);
#endif
    if (element->is_bending) refract(ray, element, eye_table, sense, &at);
  }
  ray->z += vertex_z;
  return passed & is_number(ray->x + ray->tx);
}

/* pass_or_stay - rays through all elements; a lost ray stays where it was lost.
 *
 * As pass_all. hits: where each ray met each element, planes of n_padded (HAS_HITS).
 *
 * Returns status + 256 (element + 1) of every ray, RAY_OK for those that passed.
 */
INLINE intv pass_or_stay(rayv *ray, realv *length, constant element_t *elements, int n_elements,
                         global const real *eye_table, real sense, global real *hits, int n_padded,
                         size_t group) {
  intv outcome = RAY_OK;
  real vertex_z = 0;
  for (int i = 0; i < n_elements; ++i) {
    constant element_t *element = elements + i;
    const int here = 256 * (i + 1);
    ray->z += vertex_z - element->vertex_z;
    vertex_z = element->vertex_z;
    rayv next = *ray;
    crossingv at;
    arrive(&next, element, eye_table, sense, 1, &at);
    maskv alive = mask_from_int(outcome == RAY_OK);
    maskv met = is_number(next.x + next.y + next.z);
    outcome = int_from_mask(alive & !met) ? (intv)(here + RAY_MISSED) : outcome;
    alive = alive & met;
    ray->x = alive ? next.x : ray->x;
    ray->y = alive ? next.y : ray->y;
    ray->z = alive ? next.z : ray->z;
#if HAS_GRADIENTS
    ray->tx = alive ? next.tx : ray->tx;
    ray->ty = alive ? next.ty : ray->ty;
    ray->tz = alive ? next.tz : ray->tz;
#endif
#if HAS_OPL
    *length = alive ? mul_add(at.path, (realv)element->n2_incident, *length) : *length;
#endif
    const int reason = element->kind == ELEMENT_STOP ? RAY_STOPPED : RAY_OUTSIDE;
    maskv inside = is_inside(&at, element);
    outcome = int_from_mask(alive & !inside) ? (intv)(here + reason) : outcome;
    alive = alive & inside;
    if (element->is_bending) {
      refract(&next, element, eye_table, sense, &at);
      maskv through = is_number(next.tx);
      outcome = int_from_mask(alive & !through) ? (intv)(here + RAY_REFLECTED) : outcome;
      alive = alive & through;
      ray->tx = alive ? next.tx : ray->tx;
      ray->ty = alive ? next.ty : ray->ty;
      ray->tz = alive ? next.tz : ray->tz;
    }
#if HAS_HITS
    global real *hit = hits + 3 * (size_t)n_padded * i;
    store_lanes(ray->x, hit, group);
    store_lanes(ray->y, hit + n_padded, group);
    store_lanes(ray->z + vertex_z, hit + 2 * (size_t)n_padded, group);
#endif
  }
  ray->z += vertex_z;
  return outcome;
}

/* trace_rays - every ray through every element, with what became of it.
 *
 * origin     x, y, z planes of n_padded reals, mm, eye frame
 * direction  x, y, z planes, unit vectors; or one vector for all rays (HAS_SHARED_DIRECTION)
 * elements   elements in the order the rays meet them, for this direction of travel
 * eye_table  numbers of their shapes
 * sense      +1 towards the retina, -1 towards the scene
 * n_padded   rays, a multiple of WIDTH
 * position   end points, mm, planes
 * leaving    unit directions there, planes (HAS_DIRECTIONS)
 * outcome    status + 256 (element + 1)
 * opl        optical path length, mm (HAS_OPL)
 * hits       element, then x, y, z planes, mm (HAS_HITS)
 */
kernel void trace_rays(global const real *restrict origin, global const real *restrict direction,
                       constant element_t *elements, const int n_elements,
                       global const real *restrict eye_table, const real sense, const int n_padded,
                       global real *restrict position, global real *restrict leaving,
                       global int *restrict outcome, global real *restrict opl,
                       global real *restrict hits) {
  const size_t group = get_global_id(0);
  const size_t plane = n_padded;
  const real n_start = elements[0].index_incident;
  rayv start;
  start.x = load_lanes(origin, group);
  start.y = load_lanes(origin + plane, group);
  start.z = load_lanes(origin + 2 * plane, group);
#if HAS_SHARED_DIRECTION
  start.tx = n_start * direction[0];
  start.ty = n_start * direction[1];
  start.tz = n_start * direction[2];
#else
  start.tx = n_start * load_lanes(direction, group);
  start.ty = n_start * load_lanes(direction + plane, group);
  start.tz = n_start * load_lanes(direction + 2 * plane, group);
#endif
  rayv ray = start;
  realv length = 0;
  intv result = RAY_OK;
#if !HAS_HITS
  if (!all_lanes(pass_all(&ray, &length, elements, n_elements, eye_table, sense)))
#endif
  {
    ray = start;
    length = 0;
    result = pass_or_stay(&ray, &length, elements, n_elements, eye_table, sense, hits, n_padded,
                          group);
  }
  store_lanes(ray.x, position, group);
  store_lanes(ray.y, position + plane, group);
  store_lanes(ray.z, position + 2 * plane, group);
#if HAS_DIRECTIONS
  realv scale = 1 / square_root(mul_add(ray.tx, ray.tx, mul_add(ray.ty, ray.ty, ray.tz * ray.tz)));
  store_lanes(scale * ray.tx, leaving, group);
  store_lanes(scale * ray.ty, leaving + plane, group);
  store_lanes(scale * ray.tz, leaving + 2 * plane, group);
#endif
  store_int_lanes(result, outcome, group);
#if HAS_OPL
  store_lanes(length, opl, group);
#endif
}

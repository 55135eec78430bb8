/* crossing.cl - rays to the next element of an eye, whatever it is. */
#include "lib/conic.cl"
#include "lib/form.cl"
#include "lib/placement.cl"

/* cross_stop - moves rays to the plane of the stop; z is relative to it.
 *
 * A ray that is parallel to the plane becomes infinite or NaN. A stop that is shifted, turned or
 * elliptical measures in the frame of its axes (HAS_PLACED_STOP).
 */
INLINE void cross_stop(rayv *ray, constant element_t *stop, crossingv *at) {
  at->path = -ray->z / ray->tz;
  ray->x = mul_add(at->path, ray->tx, ray->x);
  ray->y = mul_add(at->path, ray->ty, ray->y);
  ray->z = 0;
#if HAS_PLACED_STOP
  const realv x = ray->x - stop->decentre_x, y = ray->y - stop->decentre_y;
  at->ax = mul_add((realv)stop->rotation[0], x, stop->rotation[3] * y);
  at->ay = mul_add((realv)stop->rotation[1], x, stop->rotation[4] * y) * stop->inverse_aspect;
#else
  at->ax = ray->x;
  at->ay = ray->y;
#endif
}

/* cross_surface - moves rays to a surface; see cross_element. */
INLINE maskv cross_surface(rayv *ray, constant element_t *s, global const real *eye_table,
                           real sense, int far_side, crossingv *at) {
#if HAS_PLACEMENTS
  /* The long way to the vertex is made in the eye frame: turning a short one costs less accuracy. */
  const realv tx = ray->tx, ty = ray->ty, tz = ray->tz;
  ray->x -= s->decentre_x;
  ray->y -= s->decentre_y;
#endif
  at->path = approach_vertex(ray, s);
#if HAS_PLACEMENTS
  if (s->is_placed) {
    enter_frame(s, &ray->x, &ray->y, &ray->z);
    enter_frame(s, &ray->tx, &ray->ty, &ray->tz);
  }
#endif
#if HAS_SHAPES
  const maskv met = form_intersect(ray, s, eye_table, sense, far_side, at);
#else
  const maskv met = conic_intersect(ray, s, sense, far_side, at);
#if HAS_FORMS
  conic_slope(ray, s, at);
#endif
#endif
  at->ax = ray->x;
  at->ay = ray->y;
#if HAS_PLACEMENTS
  if (s->is_placed) {
    leave_frame(s, &ray->x, &ray->y, &ray->z);
    leave_frame(s, &at->gx, &at->gy, &at->gz);
  }
  ray->x += s->decentre_x;
  ray->y += s->decentre_y;
  ray->tx = tx;
  ray->ty = ty;
  ray->tz = tz;
#endif
  return met;
}

/* cross_element - moves rays to an element; z is relative to its vertex before and after.
 *
 * eye_table   numbers of the shapes of all elements
 * sense       +1 towards the retina, -1 towards the scene
 * far_side    as in crossing_root
 * at out      where and how
 *
 * Returns the rays for which that is true; one that misses becomes NaN.
 */
INLINE maskv cross_element(rayv *ray, constant element_t *element, global const real *eye_table,
                           real sense, int far_side, crossingv *at) {
  if (element->kind != ELEMENT_STOP)
    return cross_surface(ray, element, eye_table, sense, far_side, at);
  cross_stop(ray, element, at);
  return -1;
}

/* is_inside - crossings within the aperture of an element. */
INLINE maskv is_inside(const crossingv *at, constant element_t *element) {
  return mul_add(at->ax, at->ax, at->ay * at->ay) <= element->aperture2;
}

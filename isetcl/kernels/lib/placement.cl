/* placement.cl - the frames of surfaces that are shifted, tilted or turned in the eye.
 *
 * Columns of s->rotation, row by row in memory, are the axes of the surface in the eye frame.
 */
#include "lib/ray.cl"

/* enter_frame - a vector of the eye frame in the frame of a surface. */
INLINE void enter_frame(constant element_t *s, realv *x, realv *y, realv *z) {
  const realv ex = *x, ey = *y, ez = *z;
  *x = mul_add((realv)s->rotation[0], ex,
               mul_add((realv)s->rotation[3], ey, s->rotation[6] * ez));
  *y = mul_add((realv)s->rotation[1], ex,
               mul_add((realv)s->rotation[4], ey, s->rotation[7] * ez));
  *z = mul_add((realv)s->rotation[2], ex,
               mul_add((realv)s->rotation[5], ey, s->rotation[8] * ez));
}

/* leave_frame - a vector of the frame of a surface in the eye frame. */
INLINE void leave_frame(constant element_t *s, realv *x, realv *y, realv *z) {
  const realv lx = *x, ly = *y, lz = *z;
  *x = mul_add((realv)s->rotation[0], lx,
               mul_add((realv)s->rotation[1], ly, s->rotation[2] * lz));
  *y = mul_add((realv)s->rotation[3], lx,
               mul_add((realv)s->rotation[4], ly, s->rotation[5] * lz));
  *z = mul_add((realv)s->rotation[6], lx,
               mul_add((realv)s->rotation[7], ly, s->rotation[8] * lz));
}

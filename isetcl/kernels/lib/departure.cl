/* departure.cl - surfaces whose sag is that of a conic and h(x, y): the conic sheared along z. */
#include "lib/lanes.cl"
#include "lib/quadric.cl"

/* departurev - h, mm, and its slopes dh/dx and dh/dy. */
typedef struct {
  realv height, slope_x, slope_y;
} departurev;

/* departure_implicit - S of the conic at z - h, and g. */
INLINE void departure_implicit(realv x, realv y, realv z, constant element_t *s,
                               const departurev *departure, slopev *slope) {
  quadric_implicit(x, y, z - departure->height, s, slope);
  slope->gx = mul_add(-slope->gz, departure->slope_x, slope->gx);
  slope->gy = mul_add(-slope->gz, departure->slope_y, slope->gy);
}

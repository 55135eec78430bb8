/* even_asphere.cl - even powers of the distance from the axis, on top of a conic. */
#include "lib/departure.cl"

/* even_asphere_departure - h = a1 rho^2 + a2 rho^4 + ..., and its slopes.
 *
 * table   a1, a2, ...: s->columns of them
 */
INLINE void even_asphere_departure(realv x, realv y, constant element_t *s,
                                   global const real *table, departurev *departure) {
  const realv u = mul_add(x, x, y * y);
  realv height = table[s->columns - 1], slope = 0;
  for (int i = s->columns - 2; i >= 0; --i) {
    slope = mul_add(slope, u, height);
    height = mul_add(height, u, (realv)table[i]);
  }
  /* height u is h, and its derivative by u is height + u slope. */
  const realv twice = R(2.0) * mul_add(slope, u, height);
  departure->height = height * u;
  departure->slope_x = twice * x;
  departure->slope_y = twice * y;
}

/* zernike_sag.cl - Zernike polynomials, written in powers of x and y, on top of a conic. */
#include "lib/departure.cl"

/* zernike_sag_departure - h = sum p_ij u^i v^j with i + j <= order, and its slopes.
 *
 * table   p_ij, highest power first: for i = order ... 0 those of j = order - i ... 0; the order is
 *         s->columns, and u = x s->per_x, v = y s->per_x
 */
INLINE void zernike_sag_departure(realv x, realv y, constant element_t *s,
                                  global const real *table, departurev *departure) {
  const realv u = s->per_x * x, v = s->per_x * y;
  realv height = 0, along_u = 0, along_v = 0;
  for (int i = 0; i <= s->columns; ++i) {
    realv of_v = table[0], slope_v = 0;
    for (int j = 1; j <= i; ++j) {
      slope_v = mul_add(slope_v, v, of_v);
      of_v = mul_add(of_v, v, (realv)table[j]);
    }
    table += i + 1;
    along_u = mul_add(along_u, u, height);
    along_v = mul_add(along_v, u, slope_v);
    height = mul_add(height, u, of_v);
  }
  departure->height = height;
  departure->slope_x = s->per_x * along_u;
  departure->slope_y = s->per_x * along_v;
}

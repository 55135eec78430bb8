/* height_map.cl - measured heights, joined by cubic B-splines, on top of a conic. */
#include "lib/departure.cl"

/* The four splines around a place along one side: number of the first, weights times 6, derivatives
 * times 2. */
typedef struct {
  intv first;
  realv weight[4], slope[4];
} splinesv;

/* splines_at - those around x, which is at `per_mm` x + (count - 1) / 2 samples of `count`.
 *
 * Beyond the border the map goes on with its value there. NaN is taken to sample 0.
 */
INLINE void splines_at(realv x, real per_mm, int count, splinesv *at) {
  const real last = (real)(count - 1);
  const realv place = mul_add((realv)per_mm, x, (realv)(R(0.5) * last));
  const realv kept = place > 0 ? smaller(place, (realv)last) : (realv)0;
  const intv cell = int_from_real(kept);
  at->first = cell < count - 2 ? cell : (intv)(count - 2);
  const realv t = kept - real_from_int(at->first), u = 1 - t;
  const realv inside = place == kept ? (realv)1 : (realv)0;
  at->weight[0] = u * u * u;
  at->weight[1] = mul_add(t * t, mul_add((realv)3, t, (realv)R(-6.0)), (realv)4);
  at->weight[2] = mul_add(u * u, mul_add((realv)3, u, (realv)R(-6.0)), (realv)4);
  at->weight[3] = t * t * t;
  at->slope[0] = -u * u * inside;
  at->slope[1] = t * mul_add((realv)3, t, (realv)R(-4.0)) * inside;
  at->slope[2] = u * mul_add((realv)R(-3.0), u, (realv)4) * inside;
  at->slope[3] = t * t * inside;
}

/* height_map_departure - h and its slopes, from 16 coefficients around every lane.
 *
 * table   coefficients, s->rows + 2 rows of s->columns + 2, the first row at -y
 */
INLINE void height_map_departure(realv x, realv y, constant element_t *s,
                                 global const real *table, departurev *departure) {
  splinesv in_x, in_y;
  splines_at(x, s->per_x, s->columns, &in_x);
  splines_at(y, s->per_y, s->rows, &in_y);
  const int stride = s->columns + 2;
  union {
    intv all;
    int lane[WIDTH];
  } corner;
  corner.all = in_y.first * stride + in_x.first;
  /* Lane by lane in a loop that is not unrolled: 1024 loads in a row would take long to compile. */
  lanesv_t coefficient[16];
  for (int l = 0; l < WIDTH; ++l) {
    global const real *from = table + corner.lane[l];
#pragma unroll
    for (int k = 0; k < 16; ++k) coefficient[k].lane[l] = from[(k >> 2) * stride + (k & 3)];
  }
  realv height = 0, along_x = 0, along_y = 0;
#pragma unroll
  for (int j = 0; j < 4; ++j) {
    realv across = 0, lean = 0;
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      across = mul_add(coefficient[4 * j + i].all, in_x.weight[i], across);
      lean = mul_add(coefficient[4 * j + i].all, in_x.slope[i], lean);
    }
    height = mul_add(across, in_y.weight[j], height);
    along_x = mul_add(lean, in_y.weight[j], along_x);
    along_y = mul_add(across, in_y.slope[j], along_y);
  }
  departure->height = height * R(0.027777777777777777778);
  departure->slope_x = along_x * (s->per_x * R(0.083333333333333333333));
  departure->slope_y = along_y * (s->per_y * R(0.083333333333333333333));
}

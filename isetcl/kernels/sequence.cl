/* sequence.cl - the numbers that samples are made of, for those who check them. */
#include "lib/disc.cl"
#include "lib/sobol.cl"

/* sobol_points - samples 0 ... samples - 1 of one dimension.
 *
 * x     a plane of stream numbers, one a lane
 * out   a plane for every sample
 */
kernel void sobol_points(global const real *x, const int n, global real *out, const int samples,
                         const int dimension) {
  const size_t g = get_global_id(0);
  uintv stream = uint_from_int(int_from_real(load_lanes(x, g)));
  for (int i = 0; i < samples; ++i)
    store_lanes(sobol_coordinate((uint)i, dimension, stream), out + (size_t)i * n, g);
}

/* disc_points - x: planes u and v of the unit square; out: planes x and y of the unit disc. */
kernel void disc_points(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  realv dx, dy;
  concentric_disc(load_lanes(x, g), load_lanes(x + n, g), &dx, &dy);
  store_lanes(dx, out, g);
  store_lanes(dy, out + n, g);
}

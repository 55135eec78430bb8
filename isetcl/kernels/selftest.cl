/* selftest.cl - what the start-up self-test asks of a device before it is trusted. */
#include "lib/real.cl"

/* arithmetic - the operations whose rounding the kernels rely on, one value a lane.
 *
 * a, b, c   n inputs, n a multiple of WIDTH
 * results   planes of n: a b + c; sqrt a; a / b; a b - c d formed as the kernels do, with d = c
 */
kernel void arithmetic(global const real *a, global const real *b, global const real *c,
                       const int n, global real *results) {
  const size_t group = get_global_id(0);
  realv x = load_lanes(a, group), y = load_lanes(b, group), z = load_lanes(c, group);
  store_lanes(mul_add(x, y, z), results, group);
  store_lanes(square_root(x), results + n, group);
  store_lanes(x / y, results + 2 * (size_t)n, group);
  realv product = z * z;
  realv rounding = mul_add(-z, z, product);
  realv difference = mul_add(x, y, -product);
  difference += rounding;
  store_lanes(difference, results + 3 * (size_t)n, group);
}

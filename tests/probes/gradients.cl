/* gradients.cl - functions of gradient-index lenses, one by one. */
#include "lib/gradient.cl"
#include "lib/power.cl"

kernel void probe_power(global const real *x, const int n, global real *out, const real p,
                        const int whole_p) {
  const size_t g = get_global_id(0);
  realv v = load_lanes(x, g);
  store_lanes(log2_lanes(v), out, g);
  store_lanes(exp2_lanes(load_lanes(x + n, g)), out + n, g);
  store_lanes(power_lanes(v, p), out + 2 * n, g);
  store_lanes(whole_power(v, whole_p), out + 3 * n, g);
}

kernel void probe_index_force(global const real *profile, global const real *x, const int n,
                                global real *out) {
  const size_t g = get_global_id(0);
  realv fx, fy, fz;
  realv n2 = index_force(profile, load_lanes(x, g), load_lanes(x + n, g),
                           load_lanes(x + 2 * n, g), &fx, &fy, &fz);
  store_lanes(n2, out, g);
  store_lanes(fx, out + n, g);
  store_lanes(fy, out + 2 * n, g);
  store_lanes(fz, out + 3 * n, g);
}

kernel void probe_steps(global const real *profile, global const real *x, const int n,
                              global real *out, const real h, const int steps) {
  const size_t g = get_global_id(0);
  rayv ray;
  ray.x = load_lanes(x, g);
  ray.y = load_lanes(x + n, g);
  ray.z = load_lanes(x + 2 * n, g);
  ray.tx = load_lanes(x + 3 * n, g);
  ray.ty = load_lanes(x + 4 * n, g);
  ray.tz = load_lanes(x + 5 * n, g);
  realv length = 0;
  for (int i = 0; i < steps; ++i) length += gradient_step(&ray, profile, h);
  store_lanes(ray.x, out, g);
  store_lanes(ray.y, out + n, g);
  store_lanes(ray.z, out + 2 * n, g);
  store_lanes(ray.tx, out + 3 * n, g);
  store_lanes(ray.ty, out + 4 * n, g);
  store_lanes(ray.tz, out + 5 * n, g);
  store_lanes(length, out + 6 * n, g);
}

/* bend.cl - what bends rays, one ray a lane, for tests/test_bend_functions.py. */
#include "lib/bend.cl"

kernel void probe_log(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  store_lanes(natural_log(load_lanes(x, g)), out, g);
}

kernel void probe_draw(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  drawv drawn;
  draw(load_lanes(x, g), load_lanes(x + n, g), &drawn);
  store_lanes(drawn.x, out, g);
  store_lanes(drawn.y, out + n, g);
  store_lanes(drawn.beyond, out + 2 * n, g);
}

/* Planes in: x, y, T, direction of the draw, share beyond. Out: T, and whether the ray goes on. */
kernel void probe_diffract(global const real *bend, global const real *x, const int n,
                           global real *out) {
  const size_t g = get_global_id(0);
  rayv ray = {load_lanes(x, g),         load_lanes(x + n, g),     (realv)0,
              load_lanes(x + 2 * n, g), load_lanes(x + 3 * n, g), load_lanes(x + 4 * n, g)};
  drawv drawn = {load_lanes(x + 5 * n, g), load_lanes(x + 6 * n, g), load_lanes(x + 7 * n, g)};
  maskv goes_on = diffract(&ray, bend, &drawn, -1);
  store_lanes(ray.tx, out, g);
  store_lanes(ray.ty, out + n, g);
  store_lanes(ray.tz, out + 2 * n, g);
  store_lanes(goes_on ? (realv)1 : (realv)0, out + 3 * n, g);
}

/* Planes in: T, direction of the draw, share beyond. Out: T. */
kernel void probe_scatter(global const real *bend, global const real *x, const int n,
                          global real *out) {
  const size_t g = get_global_id(0);
  rayv ray = {(realv)0,         (realv)0,             (realv)0,
              load_lanes(x, g), load_lanes(x + n, g), load_lanes(x + 2 * n, g)};
  drawv drawn = {load_lanes(x + 3 * n, g), load_lanes(x + 4 * n, g), load_lanes(x + 5 * n, g)};
  scatter(&ray, bend, &drawn);
  store_lanes(ray.tx, out, g);
  store_lanes(ray.ty, out + n, g);
  store_lanes(ray.tz, out + 2 * n, g);
}

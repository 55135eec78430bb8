/* functions.cl - device functions, one value a lane, for tests/test_device_functions.py. */
#include "lib/camera.cl"
#include "lib/scene.cl"
#include "lib/bounce.cl"
#include "lib/turn.cl"
#include "sequence.cl"

kernel void probe_sine_cosine(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  realv s, c;
  sine_cosine_quarter(load_lanes(x, g), &s, &c);
  store_lanes(s, out, g);
  store_lanes(c, out + n, g);
}

kernel void probe_rounding(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  realv v = load_lanes(x, g);
  store_lanes(real_from_int(whole(v)), out, g);
  store_lanes(magnitude(v), out + n, g);
  store_lanes(larger(v, (realv)R(0.25)), out + 2 * n, g);
  store_lanes(smaller(v, (realv)R(0.25)), out + 3 * n, g);
  store_lanes(is_number(v) ? (realv)1 : (realv)0, out + 4 * n, g);
  store_lanes(real_from_int(int_from_uint(lane_numbers())), out + 5 * n, g);
}

kernel void probe_all_lanes(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  store_lanes((realv)(real)all_lanes(load_lanes(x, g) > 0), out, g);
}

kernel void probe_turn(global const real *x, const int n, global real *out) {
  const size_t g = get_global_id(0);
  store_lanes(turn_of(load_lanes(x + n, g), load_lanes(x, g)), out, g);
}

/* The eight numbers of a bounce for samples 0 ... n - 1 of a stream. */
kernel void probe_bounce(global const real *x, const int n, global real *out, const int bits,
                         const int bounce) {
  const size_t g = get_global_id(0);
  realv number[8];
  const uintv sample = (uint)(g * WIDTH) + lane_numbers();
  for (int set = 0; set < 2; ++set)
    bounce_numbers(sample, bits, (uintv)((uint)x[0]), bounce, set, number + 4 * set);
  for (int k = 0; k < 8; ++k) store_lanes(number[k], out + (size_t)k * n, g);
}

kernel void probe_horner(constant camera_t *camera, global const real *x, const int n,
                         global real *out) {
  const size_t g = get_global_id(0);
  store_lanes(horner(camera->chord, camera->n_chord, load_lanes(x, g)), out, g);
}

kernel void probe_sizes(global int *out) {
  out[0] = sizeof(element_t);
  out[1] = sizeof(camera_t);
  out[2] = sizeof(pupil_t);
  out[3] = sizeof(patch_t);
  out[4] = sizeof(sphere_t);
  out[5] = sizeof(scene_t);
  out[6] = sizeof(material_t);
  out[7] = sizeof(image_t);
}

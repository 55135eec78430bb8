/* start_paths.cl - the first stage of the path pipeline: samples on the retina to rays in the scene.
 */
#include "lib/start.cl"

/* start_paths - rays leaving the cornea for n_samples samples of every band and pixel.
 *
 * slot      ((sample - first) * bands + band) * n_padded + pixel
 * origin, direction   out: planes x, y, z of n_slots values
 *
 * The other arguments are those of render_direct.
 */
kernel void start_paths(constant camera_t *camera, constant pupil_t *pupils,
                        constant element_t *elements, const int n_elements,
                        global const real *restrict eye_table, const uint first,
                        const uint block, const uint stream, const int n_padded,
                        const int n_slots, global real *restrict origin,
                        global real *restrict direction, global real *restrict weight,
                        global real *restrict passed) {
  const size_t group = get_global_id(0);
  const uint band = get_global_id(1), bands = get_global_size(1), number = get_global_id(2);
  startv start;
  start_group(camera, pupils, elements, n_elements, eye_table, (int)band, (int)(group * WIDTH),
              band * block + first + number, stream, &start);
  const size_t at = (((size_t)number * bands + band) * n_padded) / WIDTH + group;
  const size_t plane = (size_t)n_slots / WIDTH;
  store_lanes(start.ox, origin, at);
  store_lanes(start.oy, origin, at + plane);
  store_lanes(start.oz, origin, at + 2 * plane);
  store_lanes(start.dx, direction, at);
  store_lanes(start.dy, direction, at + plane);
  store_lanes(start.dz, direction, at + 2 * plane);
  store_lanes(start.weight, weight, at);
}

/* given_paths - the same for given rays, which all samples of a pixel share.
 *
 * starts   planes of origin, direction and the distance beyond which surfaces are looked for
 */
kernel void given_paths(global const real *restrict starts, const uint first, const uint block,
                        const uint stream, const int n_padded, const int n_slots,
                        global real *restrict origin, global real *restrict direction,
                        global real *restrict weight, global real *restrict passed) {
  const size_t group = get_global_id(0);
  const uint band = get_global_id(1), bands = get_global_size(1), number = get_global_id(2);
  const size_t at = (((size_t)number * bands + band) * n_padded) / WIDTH + group;
  const size_t plane = (size_t)n_slots / WIDTH, from = (size_t)n_padded / WIDTH;
  for (int k = 0; k < 3; ++k) {
    store_lanes(load_lanes(starts, group + k * from), origin, at + k * plane);
    store_lanes(load_lanes(starts, group + (3 + k) * from), direction, at + k * plane);
  }
  store_lanes((realv)1, weight, at);
  store_lanes(load_lanes(starts, group + 6 * from), passed, at);
}

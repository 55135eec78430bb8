/* start_paths.cl - the first stage of the path pipeline: samples on the retina to rays in the scene.
 *
 * The same samples as the direct pipeline draws, written out instead of followed.
 */
#include "lib/camera.cl"
#include "lib/eye.cl"
#include "lib/sobol.cl"

/* start_paths - rays leaving the cornea, metres, for n_samples samples of every band and pixel.
 *
 * slot      ((sample - first) * bands + band) * n_padded + pixel
 * origin, direction   out: planes x, y, z of n_slots values; directions are unit vectors
 * weight    out: irradiance per unit radiance, 0 for a lost ray
 *
 * The other arguments are those of render_direct.
 */
kernel void start_paths(constant camera_t *camera, constant pupil_t *pupils,
                        constant element_t *elements, const int n_elements, const uint first,
                        const uint block, const uint stream, const int n_padded,
                        const int n_slots, global real *restrict origin,
                        global real *restrict direction, global real *restrict weight) {
  const size_t group = get_global_id(0);
  const uint band = get_global_id(1), bands = get_global_size(1), number = get_global_id(2);
  constant pupil_t *pupil = pupils + band;
  uintv pixel = (uint)(group * WIDTH) + lane_numbers();
  uintv row = pixel / (uint)camera->tile_width;
  uintv column = pixel - row * (uint)camera->tile_width;
  row += (uint)camera->tile_y;
  column += (uint)camera->tile_x;
  uintv pixel_stream = mix_bits(mix_bits(row * (uint)camera->image_width + column) + stream);
  const uint sample = band * block + first + number;
  realv u = sobol_coordinate(sample, 0, pixel_stream);
  realv v = sobol_coordinate(sample, 1, pixel_stream);
  realv gx = mul_add(real_from_int(int_from_uint(column)) + sobol_coordinate(sample, 2, pixel_stream),
                     (realv)camera->step_x, (realv)camera->left);
  realv gy = mul_add(real_from_int(int_from_uint(row)) + sobol_coordinate(sample, 3, pixel_stream),
                     (realv)camera->step_y, (realv)camera->top);
  realv s = mul_add(gx, gx, gy * gy);
  rayv ray;
  retinal_point(camera, gx, gy, s, &ray);
  realv carried = aim_at_pupil(camera, pupil, gx, gy, s, u, v, &ray);
  maskv passed = leave_eye(&ray, elements + band * n_elements, n_elements);
  const real scale = pupil->inverse_object_index;
  const size_t at = (((size_t)number * bands + band) * n_padded) / WIDTH + group;
  const size_t plane = (size_t)n_slots / WIDTH;
  store_lanes(passed ? ray.x * R(1e-3) : (realv)0, origin, at);
  store_lanes(passed ? ray.y * R(1e-3) : (realv)0, origin, at + plane);
  store_lanes(passed ? ray.z * R(1e-3) : (realv)0, origin, at + 2 * plane);
  store_lanes(passed ? ray.tx * scale : (realv)0, direction, at);
  store_lanes(passed ? ray.ty * scale : (realv)0, direction, at + plane);
  store_lanes(passed ? ray.tz * scale : (realv)-1, direction, at + 2 * plane);
  store_lanes(passed ? carried : (realv)0, weight, at);
}

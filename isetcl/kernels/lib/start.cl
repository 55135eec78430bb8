/* start.cl - samples on the retina to rays in the scene.
 */
#include "lib/camera.cl"
#include "lib/eye.cl"
#include "lib/pixel.cl"
#include "lib/sobol.cl"

/* Rays as they leave the cornea: metres, unit vectors, and irradiance per unit radiance. */
typedef struct {
  realv ox, oy, oz, dx, dy, dz, weight;
} startv;

/* start_group - the rays of one sample in WIDTH neighbouring pixels of a tile.
 *
 * pupils, elements   of all bands
 * first_pixel   number of the first pixel in the tile, row by row
 * sample        number of the sample in its band's part of the sequence
 *
 * Lost rays have weight 0. The same samples as the direct pipeline draws.
 */
INLINE void start_group(constant camera_t *camera, constant pupil_t *pupils,
                        constant element_t *elements, int n_elements,
                        global const real *eye_table, int band, int first_pixel, uint sample,
                        uint stream, startv *start) {
  intv x;
  intv y = divide(first_pixel + int_from_uint(lane_numbers()), camera->tile_width, &x);
  uintv row = uint_from_int(y) + (uint)camera->tile_y;
  uintv column = uint_from_int(x) + (uint)camera->tile_x;
  uintv pixel_stream = mix_bits(mix_bits(row * (uint)camera->image_width + column) + stream);
  realv u = sobol_coordinate(sample, 0, pixel_stream);
  realv v = sobol_coordinate(sample, 1, pixel_stream);
  pixelv place;
  pixel_at(camera, eye_table, row, column, &place);
  realv gx, gy;
  point_in_pixel(camera, &place, sobol_coordinate(sample, 2, pixel_stream),
                 sobol_coordinate(sample, 3, pixel_stream), &gx, &gy);
  rayv ray;
  realv carried = aim_from_retina(camera, pupils + band, elements, eye_table, gx, gy, u, v, &ray);
  bendsv bends;
  draw_bends(sample, pixel_stream, &bends);
  maskv passed = leave_eye(&ray, elements + band * n_elements, n_elements, eye_table, &bends);
  const real scale = pupils[band].inverse_object_index;
  start->ox = passed ? ray.x * R(1e-3) : (realv)0;
  start->oy = passed ? ray.y * R(1e-3) : (realv)0;
  start->oz = passed ? ray.z * R(1e-3) : (realv)0;
  start->dx = passed ? ray.tx * scale : (realv)0;
  start->dy = passed ? ray.ty * scale : (realv)0;
  start->dz = passed ? ray.tz * scale : (realv)-1;
  start->weight = passed ? carried : (realv)0;
}

/* shade.cl - the stage of the path pipeline that looks at what paths met, and sends them on; and the
 * one that sums what they carried.
 */
#include "lib/shade.cl"

/* shade - shades all living paths.
 *
 * counts   out: how many paths go on (next), and how many wait for a light (shadowed)
 */
kernel void shade(
    const int n_alive, global const int *restrict alive, const int n_slots,
    global real *restrict weight, global real *restrict distance,
    global int *restrict hit_object, global int *restrict hit_triangle,
    global real *restrict hit_uv, global real *restrict origin,
    global real *restrict direction, global real *restrict throughput,
    global real *restrict radiance, global real *restrict last_density,
    global real *restrict passed, global int *restrict bounces, global real *restrict ray_width,
    constant world_t *world,
    constant flat_t *flats, constant ball_t *balls, global const instance_t *restrict instances,
    global const object_t *restrict objects, global const substance_t *restrict substances,
    global const texture_t *restrict textures, global const light_t *restrict lights,
    global const float *restrict texels, global const real *restrict corners,
    global const real *restrict normals, global const real *restrict uvs,
    global const real *restrict spectra, const int n_columns,
    global const int *restrict band_first, const int n_bands, const int n_padded,
    constant tile_t *tile, const uint first_sample, const uint block, const int bits,
    const uint stream, const int bounce, const int max_bounces, global int *restrict next,
    global int *restrict shadowed, global int *restrict counts, global real *restrict shadow_origin,
    global real *restrict shadow_direction, global real *restrict shadow_most,
    global real *restrict shadow_light) {
  /* A counter shared by all work-items is dear on a CPU; a chunk of paths asks it once. */
  const int begin = (int)get_global_id(0) * PATHS_AN_ITEM;
  const int end = begin + PATHS_AN_ITEM < n_alive ? begin + PATHS_AN_ITEM : n_alive;
  const shapes_t shapes = {world, flats, balls, 0, 0, 0, instances};
  const triangles_t triangles = {corners, normals, uvs};
  const looks_t looks = {objects, substances, textures, lights, texels, spectra, n_columns};
  const paths_t paths = {origin,        direction,        weight,      distance,
                         hit_uv,        hit_object,       hit_triangle, throughput,
                         radiance,      last_density,     passed,      bounces,
                         ray_width,
                         shadow_origin, shadow_direction, shadow_most, shadow_light,
                         n_slots};
  const samples_t samples = {tile, band_first, n_bands, n_padded, bits, first_sample, block, stream,
                             0, 0};
  int going[PATHS_AN_ITEM], waiting[PATHS_AN_ITEM];
  int n_going = 0, n_waiting = 0;
  for (int first = begin; first < end; first += WIDTH) {
    slotsv at;
    slots_of(alive, first, n_alive, bounce == 0, &at);
    int go[WIDTH], wait[WIDTH];
    shade_group(&shapes, &triangles, &looks, &paths, &samples, &at, bounce, max_bounces, go, wait);
    for (int i = 0; i < at.count; ++i) {
      going[n_going] = waiting[n_waiting] = LANE(at.slot, i);
      n_going += go[i];
      n_waiting += wait[i];
    }
  }
  if (n_going > 0) {
    const int at = atomic_add(counts, n_going);
    for (int i = 0; i < n_going; ++i) next[at + i] = going[i];
  }
  if (n_waiting > 0) {
    const int at = atomic_add(counts + 1, n_waiting);
    for (int i = 0; i < n_waiting; ++i) shadowed[at + i] = waiting[i];
  }
}

/* gather - the mean over samples of weight times radiance, for every pixel, band and wavelength.
 *
 * film   planes (band, wavelength of the band) of n_padded pixels
 */
kernel void gather(const int n_samples, const int n_bands, const int n_padded, const int n_slots,
                   global const real *restrict weight, global const real *restrict radiance,
                   global real *restrict film) {
  const int first = (int)get_global_id(0) * WIDTH, band = get_global_id(1);
  realv sum[4];
  for (int k = 0; k < 4; ++k) sum[k] = (realv)0;
  for (int s = 0; s < n_samples; ++s) {
    const size_t slot = ((size_t)s * n_bands + band) * n_padded + first;
    realv w = *(global const realv_mem *)(weight + slot);
    for (int k = 0; k < 4; ++k)
      sum[k] = mul_add(w, *(global const realv_mem *)(radiance + (size_t)k * n_slots + slot),
                       sum[k]);
  }
  const real scale = R(1.0) / n_samples;
  for (int k = 0; k < 4; ++k)
    *(global realv_mem *)(film + ((size_t)band * 4 + k) * n_padded + first) = sum[k] * scale;
}

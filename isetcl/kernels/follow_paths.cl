/* follow_paths.cl - the path pipeline in one kernel, for devices with large caches.
 *
 * A work-item follows all samples of one band in GROUP_PIXELS pixels from the retina to their ends,
 * stage by stage. What paths carry stays in the memory of the work-group, which is the cache of a
 * CPU's core; nothing is written to device memory but the film.
 */
#include "lib/find.cl"
#include "lib/shade.cl"
#include "lib/start.cl"

#define GROUP_PATHS (GROUP_PIXELS * SAMPLES_AT_ONCE)

INLINE void store_plane(realv value, local real *plane, int first) {
  *(local realv_mem *)(plane + first) = value;
}

kernel void follow_paths(
    constant camera_t *camera, constant pupil_t *pupils, constant element_t *elements,
    const int n_elements, global const real *restrict eye_table, constant world_t *world,
    constant flat_t *flats, constant ball_t *balls, global const real8 *restrict nodes,
    global const real8 *restrict blocks, global const int *restrict triangle_object,
    global const instance_t *restrict instances, global const object_t *restrict objects,
    global const substance_t *restrict substances, global const texture_t *restrict textures,
    global const light_t *restrict lights, global const float *restrict texels,
    global const real *restrict corners, global const real *restrict normals,
    global const real *restrict uvs, global const real *restrict spectra, const int n_columns,
    global const int *restrict band_first, constant tile_t *tile, const uint first_sample,
    const int n_samples, const uint block, const int bits, const uint stream,
    const int max_bounces, const int most_segments, const int n_padded,
    global const real *restrict starts, global real *restrict film) {
  const int first_pixel = (int)get_global_id(0) * GROUP_PIXELS;
  const int band = get_global_id(1);
  local real origin[3 * GROUP_PATHS], direction[3 * GROUP_PATHS], weight[GROUP_PATHS];
  local real distance[GROUP_PATHS], hit_uv[2 * GROUP_PATHS];
  local int object[GROUP_PATHS], triangle[GROUP_PATHS];
  local real throughput[4 * GROUP_PATHS], radiance[4 * GROUP_PATHS], last_density[GROUP_PATHS];
  local real passed[HAS_ADDITIVE || STARTS_GIVEN ? GROUP_PATHS : 1];
  local int bounces[HAS_ADDITIVE ? GROUP_PATHS : 1];
  local real ray_width[HAS_LEVELS ? GROUP_PATHS : 1];
  local real shadow_origin[HAS_LIGHTS ? 3 * GROUP_PATHS : 1];
  local real shadow_direction[HAS_LIGHTS ? 3 * GROUP_PATHS : 1];
  local real shadow_most[HAS_LIGHTS ? GROUP_PATHS : 1];
  local real shadow_light[HAS_LIGHTS ? 4 * GROUP_PATHS : 1];
  local int lists[2 * GROUP_PATHS], shadowed[HAS_LIGHTS ? GROUP_PATHS : 1];
  const int n_slots = n_samples * GROUP_PIXELS;
  const paths_t paths = {origin,        direction,        weight,      distance,
                         hit_uv,        object,           triangle,    throughput,
                         radiance,      last_density,     passed,      bounces,
                         ray_width,     shadow_origin, shadow_direction, shadow_most, shadow_light,
                         n_slots};
  const shapes_t shapes = {world, flats, balls, nodes, blocks, triangle_object, instances};
  const triangles_t triangles = {corners, normals, uvs};
  const looks_t looks = {objects, substances, textures, lights, texels, spectra, n_columns};
  const samples_t samples = {tile,         band_first, 1,      GROUP_PIXELS, bits,
                             first_sample, block,      stream, band,         first_pixel};
  /* Leave the eye. */
  for (int first = 0; first < n_slots; first += WIDTH) {
    const int sample = first / GROUP_PIXELS, pixel = first - sample * GROUP_PIXELS;
#if STARTS_GIVEN
    const size_t group = (size_t)(first_pixel + pixel) / WIDTH, plane = (size_t)n_padded / WIDTH;
    for (int k = 0; k < 3; ++k) {
      store_plane(load_lanes(starts, group + k * plane), origin + k * n_slots, first);
      store_plane(load_lanes(starts, group + (3 + k) * plane), direction + k * n_slots, first);
    }
    store_plane((realv)1, weight, first);
    store_plane(load_lanes(starts, group + 6 * plane), passed, first);
#else
    startv start;
    start_group(camera, pupils, elements, n_elements, eye_table, band, first_pixel + pixel,
                (uint)band * block + first_sample + (uint)sample, stream, &start);
    store_plane(start.ox, origin, first);
    store_plane(start.oy, origin + n_slots, first);
    store_plane(start.oz, origin + 2 * n_slots, first);
    store_plane(start.dx, direction, first);
    store_plane(start.dy, direction + n_slots, first);
    store_plane(start.dz, direction + 2 * n_slots, first);
    store_plane(start.weight, weight, first);
#endif
  }
  /* Meet, shade and connect until no path is left. */
  int alive = n_slots;
  for (int segment = 0; segment < most_segments && alive > 0; ++segment) {
    local int *now = lists + (segment & 1) * GROUP_PATHS;
    local int *next = lists + (1 - (segment & 1)) * GROUP_PATHS;
    int n_next = 0, n_shadowed = 0;
    slotsv at;
    for (int first = 0; first < alive; first += WIDTH) {
      slots_of(now, first, alive, segment == 0, &at);
      find_group(&shapes, &triangles, &looks, &paths, &at, segment == 0, stream);
    }
    for (int first = 0; first < alive; first += WIDTH) {
      slots_of(now, first, alive, segment == 0, &at);
      int go[WIDTH], wait[WIDTH];
      shade_group(&shapes, &triangles, &looks, &paths, &samples, &at, segment, max_bounces, go,
                  wait);
      for (int i = 0; i < at.count; ++i) {
        next[n_next] = LANE(at.slot, i);
        n_next += go[i];
#if HAS_LIGHTS
        shadowed[n_shadowed] = LANE(at.slot, i);
        n_shadowed += wait[i];
#endif
      }
    }
#if HAS_LIGHTS
    for (int first = 0; first < n_shadowed; first += WIDTH) {
      slots_of(shadowed, first, n_shadowed, 0, &at);
      connect_group(&shapes, &triangles, &looks, &paths, &at);
    }
#endif
    alive = n_next;
  }
  /* Sum over samples. */
  const real scale = R(1.0) / n_samples;
  for (int pixel = 0; pixel < GROUP_PIXELS; pixel += WIDTH) {
    realv sum[4];
    for (int k = 0; k < 4; ++k) sum[k] = (realv)0;
    for (int slot = pixel; slot < n_slots; slot += GROUP_PIXELS) {
      realv w = *(local const realv_mem *)(weight + slot);
      for (int k = 0; k < 4; ++k)
        sum[k] = mul_add(w, *(local const realv_mem *)(radiance + k * n_slots + slot), sum[k]);
    }
    for (int k = 0; k < 4; ++k)
      *(global realv_mem *)(film + ((size_t)band * 4 + k) * n_padded + first_pixel + pixel) =
          sum[k] * scale;
  }
}

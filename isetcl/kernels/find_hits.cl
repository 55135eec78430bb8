/* find_hits.cl - the stages of the path pipeline that look for surfaces.
 *
 * A path has a slot, and everything is written to its own slot, so that the image does not depend on
 * the order in which paths are listed. A work-item follows WIDTH paths.
 */
#include "lib/find.cl"

/* find_hits - what every living path meets.
 *
 * passed   distance behind which a path looks for surfaces (HAS_ADDITIVE)
 */
kernel void find_hits(const int n_alive, global const int *restrict alive, const int n_slots,
                      global real *restrict origin, global real *restrict direction,
                      global real *restrict weight, constant world_t *world,
                      constant flat_t *flats, constant ball_t *balls,
                      global const real8 *restrict nodes, global const real8 *restrict blocks,
                      global const int *restrict triangle_object,
                      global const instance_t *restrict instances,
                      global const object_t *restrict objects,
                      global const texture_t *restrict textures,
                      global const float *restrict texels, global const real *restrict corners,
                      global const real *restrict uvs, global real *restrict passed,
                      global real *restrict distance, global int *restrict object,
                      global int *restrict triangle, global real *restrict hit_uv,
                      const int is_first, const uint stream) {
  const int first = (int)get_global_id(0) * WIDTH;
  if (first >= n_alive) return;
  const shapes_t shapes = {world, flats, balls, nodes, blocks, triangle_object, instances};
  const triangles_t triangles = {corners, corners, uvs};
  const looks_t looks = {objects, 0, textures, 0, texels, 0, 0};
  const paths_t paths = {origin, direction, weight, distance, hit_uv, object, triangle, 0, 0,
                         0,      passed,    0,      0,        0,      0,      0,        0, n_slots};
  slotsv at;
  slots_of(alive, first, n_alive, is_first, &at);
  find_group(&shapes, &triangles, &looks, &paths, &at, is_first, stream);
}

#if HAS_LIGHTS
/* connect - adds the light that nothing hides. */
kernel void connect(const int n_shadowed, global const int *restrict shadowed, const int n_slots,
                    global real *restrict origin, global real *restrict direction,
                    global real *restrict most, global real *restrict light,
                    global real *restrict radiance, constant world_t *world,
                    constant flat_t *flats, constant ball_t *balls,
                    global const real8 *restrict nodes, global const real8 *restrict blocks,
                    global const int *restrict triangle_object,
                    global const instance_t *restrict instances,
                    global const object_t *restrict objects,
                    global const texture_t *restrict textures,
                    global const float *restrict texels, global const real *restrict corners,
                    global const real *restrict uvs) {
  const int first = (int)get_global_id(0) * WIDTH;
  if (first >= n_shadowed) return;
  const shapes_t shapes = {world, flats, balls, nodes, blocks, triangle_object, instances};
  const triangles_t triangles = {corners, corners, uvs};
  const looks_t looks = {objects, 0, textures, 0, texels, 0, 0};
  const paths_t paths = {0, 0, 0, 0, 0,      0,         0,    0,     radiance,
                         0, 0, 0, 0, origin, direction, most, light, n_slots};
  slotsv at;
  slots_of(shadowed, first, n_shadowed, 0, &at);
  connect_group(&shapes, &triangles, &looks, &paths, &at);
}
#endif

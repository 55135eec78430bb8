/* find_hits.cl - the stages of the path pipeline that look for surfaces.
 *
 * A path has a slot, and everything is written to its own slot, so that the image does not depend on
 * the order in which paths are listed. A work-item follows WIDTH paths.
 */
#include "lib/lights.cl"
#if HAS_CUTOUTS || HAS_ADDITIVE
#include "lib/cutouts.cl"
#endif

/* read_rays - the rays of a group. */
INLINE void read_rays(global const real *origin, global const real *direction, int n_slots,
                      const slotsv *at, pathv *ray) {
  ray->ox = read_plane(origin, at);
  ray->oy = read_plane(origin + n_slots, at);
  ray->oz = read_plane(origin + 2 * (size_t)n_slots, at);
  ray->dx = read_plane(direction, at);
  ray->dy = read_plane(direction + n_slots, at);
  ray->dz = read_plane(direction + 2 * (size_t)n_slots, at);
}

/* find_hits - what every living path meets. Paths of weight 0 meet nothing.
 *
 * passed   distance behind which a path looks for surfaces (HAS_ADDITIVE)
 */
kernel void find_hits(const int n_alive, global const int *restrict alive, const int n_slots,
                      global const real *restrict origin, global const real *restrict direction,
                      global const real *restrict weight, constant world_t *world,
                      constant flat_t *flats, constant ball_t *balls,
                      global const real8 *restrict nodes, global const real8 *restrict blocks,
                      global const int *restrict triangle_object,
                      global const instance_t *restrict instances,
                      global const object_t *restrict objects,
                      global const texture_t *restrict textures,
                      global const float *restrict texels, global const real *restrict corners,
                      global const real *restrict uvs, global const real *restrict passed,
                      global real *restrict distance, global int *restrict object,
                      global int *restrict triangle, global real *restrict hit_uv,
                      const int is_first, const uint stream) {
  const int first = (int)get_global_id(0) * WIDTH;
  if (first >= n_alive) return;
  const shapes_t shapes = {world, flats, balls, nodes, blocks, triangle_object, instances};
  slotsv at;
  slots_of(alive, first, n_alive, is_first, &at);
  pathv ray;
  read_rays(origin, direction, n_slots, &at, &ray);
  maskv active = filled(&at) & (read_plane(weight, &at) > 0);
  realv least = 0;
#if HAS_ADDITIVE
  if (!is_first) least = read_plane(passed, &at);
#endif
  shape_hitv hit;
  first_hit(&shapes, &ray, least, active, &hit);
#if HAS_CUTOUTS || HAS_ADDITIVE
  const triangles_t triangles = {corners, corners, uvs};
  const looks_t looks = {objects, 0, textures, 0, texels, 0, 0};
  for (int pass = 0; pass < MOST_PASSES; ++pass) {
    maskv is_additive;
    realv opacity = opacity_at(&shapes, &triangles, &looks, &ray, &hit, &is_additive);
    maskv open = mask_from_int(hit.object >= 0) & !is_additive &
                 (passing_number(&ray, hit.distance, stream) >= opacity);
    if (!any_lane(open)) break;
    least = mul_add(hit.distance, (realv)(1 + 16 * ROUNDING), (realv)R(1e-12));
    shape_hitv behind;
    first_hit(&shapes, &ray, least, open, &behind);
    hit.distance = open ? behind.distance : hit.distance;
    hit.object = select_int(open, behind.object, hit.object);
    hit.triangle = select_int(open, behind.triangle, hit.triangle);
    hit.u = open ? behind.u : hit.u;
    hit.v = open ? behind.v : hit.v;
  }
#endif
  write_plane(hit.distance, distance, &at);
  write_int_plane(hit.object, object, &at);
  write_int_plane(hit.triangle, triangle, &at);
  write_plane(hit.u, hit_uv, &at);
  write_plane(hit.v, hit_uv + n_slots, &at);
}

#if HAS_LIGHTS
/* connect - adds the light that nothing hides. */
kernel void connect(const int n_shadowed, global const int *restrict shadowed, const int n_slots,
                    global const real *restrict origin, global const real *restrict direction,
                    global const real *restrict most, global const real *restrict light,
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
  slotsv at;
  slots_of(shadowed, first, n_shadowed, 0, &at);
  pathv ray;
  read_rays(origin, direction, n_slots, &at, &ray);
  maskv active = filled(&at);
#if HAS_CUTOUTS || HAS_ADDITIVE
  const triangles_t triangles = {corners, corners, uvs};
  const looks_t looks = {objects, 0, textures, 0, texels, 0, 0};
  realv share = visible_share(&shapes, &triangles, &looks, &ray, read_plane(most, &at), active);
#else
  realv share = is_hidden(&shapes, &ray, read_plane(most, &at), active) ? (realv)0 : (realv)1;
#endif
  for (int k = 0; k < 4; ++k) {
    const size_t plane = (size_t)k * n_slots;
    realv sum = mul_add(share, read_plane(light + plane, &at), read_plane(radiance + plane, &at));
    write_plane(sum, radiance + plane, &at);
  }
}
#endif

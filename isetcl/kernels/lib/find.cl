/* find.cl - looking for surfaces along paths, and between points and lights.
 */
#include "lib/lights.cl"
#include "lib/paths.cl"
#include "lib/sobol.cl"
#if HAS_CUTOUTS || HAS_ADDITIVE
#include "lib/cutouts.cl"
#endif

/* find_group - what the paths of a group meet. Paths of weight 0 meet nothing. */
INLINE void find_group(const shapes_t *shapes, const triangles_t *triangles,
                       const looks_t *looks, const paths_t *paths, const slotsv *at, int is_first,
                       uint stream) {
  pathv ray;
  read_rays(paths->origin, paths->direction, paths->n_slots, at, &ray);
  maskv active = filled(at) & (read_plane(paths->weight, at) > 0);
  realv least = 0;
#if HAS_ADDITIVE || STARTS_GIVEN
  if (is_first ? STARTS_GIVEN : HAS_ADDITIVE) least = read_plane(paths->passed, at);
#endif
  shape_hitv hit;
#if HAS_ADDITIVE
  intv after = is_first ? (intv)0x7fffffff : read_int_plane(paths->object, at);
  hit_behind(shapes, &ray, least, after, active, &hit);
#else
  first_hit(shapes, &ray, least, active, &hit);
#endif
#if HAS_CUTOUTS
  for (int pass = 0; pass < MOST_PASSES; ++pass) {
    maskv is_additive;
    realv opacity = opacity_at(shapes, triangles, looks, &ray, &hit, &is_additive);
    maskv open = mask_from_int(hit.object >= 0) &
                 (passing_number(&ray, hit.distance, hit.object, stream) >= opacity);
    if (!any_lane(open)) break;
    shape_hitv behind;
    hit_behind(shapes, &ray, hit.distance, hit.object, open, &behind);
    hit.distance = open ? behind.distance : hit.distance;
    hit.object = select_int(open, behind.object, hit.object);
    hit.triangle = select_int(open, behind.triangle, hit.triangle);
    hit.u = open ? behind.u : hit.u;
    hit.v = open ? behind.v : hit.v;
  }
#endif
  write_plane(hit.distance, paths->distance, at);
  write_int_plane(hit.object, paths->object, at);
  write_int_plane(hit.triangle, paths->triangle, at);
  write_plane(hit.u, paths->hit_uv, at);
  write_plane(hit.v, paths->hit_uv + paths->n_slots, at);
}

#if HAS_LIGHTS
/* connect_group - adds the light that nothing hides. */
INLINE void connect_group(const shapes_t *shapes, const triangles_t *triangles,
                          const looks_t *looks, const paths_t *paths, const slotsv *at) {
  const int n_slots = paths->n_slots;
  pathv ray;
  read_rays(paths->shadow_origin, paths->shadow_direction, n_slots, at, &ray);
  realv most = read_plane(paths->shadow_most, at);
#if HAS_CUTOUTS || HAS_ADDITIVE
  realv share = visible_share(shapes, triangles, looks, &ray, most, filled(at));
#else
  realv share = is_hidden(shapes, &ray, most, filled(at)) ? (realv)0 : (realv)1;
#endif
  for (int k = 0; k < 4; ++k) {
    const size_t plane = (size_t)k * n_slots;
    realv light = read_plane(paths->shadow_light + plane, at);
    realv sum = mul_add(share, light, read_plane(paths->radiance + plane, at));
    write_plane(sum, paths->radiance + plane, at);
  }
}
#endif

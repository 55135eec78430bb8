/* paths.cl - the state of paths, in planes of one number a path.
 */
#include "lib/shapes.cl"

typedef struct {
  PLANE real *origin, *direction, *weight;            /* rays, and what they are worth */
  PLANE real *distance, *hit_uv;                      /* what they met */
  PLANE int *object, *triangle;
  PLANE real *throughput, *radiance, *last_density;   /* what they carry, and have found */
  PLANE real *passed;                                 /* where they look for surfaces from */
  PLANE int *bounces;
  PLANE real *width;                                  /* of the rays, where they were last */
  PLANE real *shadow_origin, *shadow_direction, *shadow_most, *shadow_light;
  int n_slots;
} paths_t;

/* read_rays - the rays of a group. */
INLINE void read_rays(PLANE const real *origin, PLANE const real *direction, int n_slots,
                      const slotsv *at, pathv *ray) {
  ray->ox = read_plane(origin, at);
  ray->oy = read_plane(origin + n_slots, at);
  ray->oz = read_plane(origin + 2 * (size_t)n_slots, at);
  ray->dx = read_plane(direction, at);
  ray->dy = read_plane(direction + n_slots, at);
  ray->dz = read_plane(direction + 2 * (size_t)n_slots, at);
}

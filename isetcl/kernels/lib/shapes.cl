/* shapes.cl - one ray against everything in the scene, for kernels that follow one path an item.
 */
#include "lib/bvh.cl"

/* What a path hit: distance (infinite for nothing), object, triangle of a mesh, coordinates u, v. */
typedef struct {
  real distance;
  int object;
  int triangle;
  real u, v;
} shape_hit_t;

/* dot3, and the product of plane equations with points, in three components. */
INLINE real dot3(real ax, real ay, real az, real bx, real by, real bz) {
  return ax * bx + ay * by + az * bz;
}

/* flat_hit - a parallelogram or the ellipse inscribed in it; the distance, or -1. */
INLINE real flat_hit(constant flat_t *flat, real ox, real oy, real oz, real dx, real dy, real dz,
                     real *u, real *v) {
  const real along = dot3(flat->normal[0], flat->normal[1], flat->normal[2], dx, dy, dz);
  const real height = dot3(flat->normal[0], flat->normal[1], flat->normal[2], flat->corner[0] - ox,
                           flat->corner[1] - oy, flat->corner[2] - oz);
  const real distance = height / along;
  const real px = ox + distance * dx - flat->corner[0];
  const real py = oy + distance * dy - flat->corner[1];
  const real pz = oz + distance * dz - flat->corner[2];
  *u = dot3(flat->axis_u[0], flat->axis_u[1], flat->axis_u[2], px, py, pz);
  *v = dot3(flat->axis_v[0], flat->axis_v[1], flat->axis_v[2], px, py, pz);
  int inside = *u >= 0 && *u < 1 && *v >= 0 && *v < 1;
  if (flat->is_round) {
    const real a = *u - R(0.5), b = *v - R(0.5);
    inside = a * a + b * b < R(0.25);
  }
  return inside && distance > 0 ? distance : -1;
}

/* ball_hit - a sphere, from outside or inside; the distance, or -1. */
INLINE real ball_hit(constant ball_t *ball, real ox, real oy, real oz, real dx, real dy, real dz) {
  const real x = ox - ball->centre[0], y = oy - ball->centre[1], z = oz - ball->centre[2];
  const real nearest = -dot3(x, y, z, dx, dy, dz);
  const real px = x + nearest * dx, py = y + nearest * dy, pz = z + nearest * dz;
  const real half2 = ball->radius * ball->radius - dot3(px, py, pz, px, py, pz);
  if (!(half2 > 0)) return -1;
  const real half_chord = scalar_root(half2);
  const real first = nearest - half_chord, second = nearest + half_chord;
  return first > 0 ? first : second;
}

/* first_hit - what a ray meets first; of two things in the same place the earlier object. */
INLINE void first_hit(real ox, real oy, real oz, real dx, real dy, real dz,
                      constant world_t *world, constant flat_t *flats, constant ball_t *balls,
                      global const real8 *nodes, global const real8 *blocks,
                      global const int *triangle_object, shape_hit_t *hit) {
  hit->distance = INFINITY, hit->object = hit->triangle = -1, hit->u = hit->v = 0;
#if HAS_FLATS
  for (int i = 0; i < world->n_flats; ++i) {
    real u, v;
    const real distance = flat_hit(flats + i, ox, oy, oz, dx, dy, dz, &u, &v);
    if (distance > 0 && distance < hit->distance * COINCIDENT)
      hit->distance = distance, hit->object = flats[i].object, hit->u = u, hit->v = v;
  }
#endif
#if HAS_BALLS
  for (int i = 0; i < world->n_balls; ++i) {
    const real distance = ball_hit(balls + i, ox, oy, oz, dx, dy, dz);
    if (distance > 0 && distance < hit->distance * COINCIDENT)
      hit->distance = distance, hit->object = balls[i].object;
  }
#endif
#if HAS_MESHES
  mesh_ray_t ray;
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  mesh_hit_t found = {hit->distance * COINCIDENT, -1, 0, 0};
  closest_hit(&ray, nodes, blocks, 0, &found);
  if (found.triangle >= 0) {
    hit->distance = found.distance;
    hit->object = triangle_object[found.triangle];
    hit->triangle = found.triangle;
    hit->u = found.u;
    hit->v = found.v;
  }
#endif
}

/* is_hidden - whether anything lies on a ray before `most`. */
INLINE int is_hidden(real ox, real oy, real oz, real dx, real dy, real dz, real most,
                     constant world_t *world, constant flat_t *flats, constant ball_t *balls,
                     global const real8 *nodes, global const real8 *blocks) {
#if HAS_FLATS
  for (int i = 0; i < world->n_flats; ++i) {
    real u, v;
    const real distance = flat_hit(flats + i, ox, oy, oz, dx, dy, dz, &u, &v);
    if (distance > 0 && distance < most) return 1;
  }
#endif
#if HAS_BALLS
  for (int i = 0; i < world->n_balls; ++i) {
    const real distance = ball_hit(balls + i, ox, oy, oz, dx, dy, dz);
    if (distance > 0 && distance < most) return 1;
  }
#endif
#if HAS_MESHES
  mesh_ray_t ray;
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  if (any_hit(&ray, nodes, blocks, 0, most)) return 1;
#endif
  return 0;
}

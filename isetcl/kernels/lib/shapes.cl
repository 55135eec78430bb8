/* shapes.cl - rays against everything in the scene.
 *
 * Flat shapes and spheres are met in lanes; a ray's way through a tree of triangles is its own, and
 * is followed one lane at a time.
 */
#include "lib/bvh.cl"
#include "lib/lanes.cl"
#if HAS_INSTANCES
#include "lib/instances.cl"
#endif

/* Cut-outs look for surfaces in several places. */
#if HAS_CUTOUTS || HAS_ADDITIVE
#define SEARCHING SHARED
#else
#define SEARCHING INLINE
#endif

/* Rays: origin and unit direction, metres. */
typedef struct {
  realv ox, oy, oz, dx, dy, dz;
} pathv;

/* What they hit: distance (infinite for nothing), object (-1), triangle of a mesh, place (u, v). */
typedef struct {
  realv distance;
  intv object, triangle;
  realv u, v;
} shape_hitv;

/* Everything that rays can hit. */
typedef struct {
  constant world_t *world;
  constant flat_t *flats;
  constant ball_t *balls;
  global const real8 *nodes;
  global const real8 *blocks;
  global const int *triangle_object;
  global const instance_t *instances;
} shapes_t;

#if HAS_FLATS
/* flat_hit - a parallelogram or the ellipse inscribed in it; the distance where it is hit. */
INLINE maskv flat_hit(constant flat_t *flat, const pathv *ray, realv *distance, realv *u,
                      realv *v) {
  realv nx = flat->normal[0], ny = flat->normal[1], nz = flat->normal[2];
  realv x = flat->foot[0] - ray->ox, y = flat->foot[1] - ray->oy, z = flat->foot[2] - ray->oz;
  realv d = dot3(nx, ny, nz, x, y, z) / dot3(nx, ny, nz, ray->dx, ray->dy, ray->dz);
  realv px = mul_add(d, ray->dx, -x), py = mul_add(d, ray->dy, -y), pz = mul_add(d, ray->dz, -z);
  *u = flat->foot_u + dot3((realv)flat->axis_u[0], (realv)flat->axis_u[1],
                           (realv)flat->axis_u[2], px, py, pz);
  *v = flat->foot_v + dot3((realv)flat->axis_v[0], (realv)flat->axis_v[1],
                           (realv)flat->axis_v[2], px, py, pz);
  *distance = d;
  if (flat->is_round) {
    realv a = *u - R(0.5), b = *v - R(0.5);
    return mul_add(a, a, b * b) < R(0.25);
  }
  return (*u >= 0) & (*u < 1) & (*v >= 0) & (*v < 1);
}
#endif

#if HAS_BALLS
/* ball_hit - a sphere, from outside or inside; the distance beyond `least` where it is hit. */
INLINE maskv ball_hit(constant ball_t *ball, const pathv *ray, realv least, realv *distance) {
  realv x = ray->ox - ball->centre[0], y = ray->oy - ball->centre[1], z = ray->oz - ball->centre[2];
  realv nearest = -dot3(x, y, z, ray->dx, ray->dy, ray->dz);
  realv px = mul_add(nearest, ray->dx, x), py = mul_add(nearest, ray->dy, y),
        pz = mul_add(nearest, ray->dz, z);
  /* What rounding leaves along the ray is no distance from it. */
  realv left = dot3(px, py, pz, ray->dx, ray->dy, ray->dz);
  realv across2 = mul_add(-left, left, dot3(px, py, pz, px, py, pz));
  realv half2 = mul_add((realv)ball->radius, (realv)ball->radius, -across2);
  maskv met = half2 > 0;
  realv half_chord = square_root(met ? half2 : (realv)0);
  realv first = nearest - half_chord;
  *distance = first > least ? first : nearest + half_chord;
  return met;
}
#endif

#if HAS_MESHES
/* mesh_hit_of_lane - the nearest triangle for one lane; see first_hit. */
SHARED void mesh_hit_of_lane(const shapes_t *shapes, real ox, real oy, real oz, real dx, real dy,
                             real dz, real least, mesh_hit_t *found, int *object) {
  *object = -1;
  mesh_ray_t ray;
#if HAS_TRIANGLES
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  closest_hit(&ray, shapes->nodes, shapes->blocks, least, found);
  if (found->triangle >= 0) *object = shapes->triangle_object[found->triangle];
#endif
#if HAS_INSTANCES
  closest_instance(shapes->world, shapes->instances, shapes->nodes, shapes->blocks, ox, oy, oz, dx,
                   dy, dz, least, found, object);
#endif
}

/* mesh_hides_lane - whether any triangle lies before `most`, for one lane; see is_hidden. */
SHARED int mesh_hides_lane(const shapes_t *shapes, real ox, real oy, real oz, real dx, real dy,
                           real dz, real most) {
#if HAS_TRIANGLES
  mesh_ray_t ray;
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  if (any_hit(&ray, shapes->nodes, shapes->blocks, 0, most)) return 1;
#endif
#if HAS_INSTANCES
  return any_instance(shapes->world, shapes->instances, shapes->nodes, shapes->blocks, ox, oy, oz,
                      dx, dy, dz, most);
#else
  return 0;
#endif
}

/* cut_by_slab - the part of rays between two planes, no shorter than it is. */
INLINE void cut_by_slab(realv o, realv d, real low, real high, realv *enter, realv *leave) {
  maskv is_flat = magnitude(d) < R(1e-18);
  realv inverse = 1 / (is_flat ? (realv)R(1e-18) : d);
  inverse = is_flat ? (realv)R(1e24) : inverse;
  realv a = (low - o) * inverse, b = (high - o) * inverse;
  realv slack = (magnitude(a) + magnitude(b)) * (4 * ROUNDING) + (is_flat ? (realv)R(1e15) : (realv)0);
  *enter = larger(*enter, smaller(a, b) - slack);
  *leave = smaller(*leave, larger(a, b) + slack);
}

/* may_meet_meshes - whether rays cross the box around all meshes between `least` and `most`.
 *
 * Rays that do not are spared the way down the tree.
 */
INLINE maskv may_meet_meshes(constant world_t *world, const pathv *ray, realv least, realv most) {
  realv enter = least, leave = most;
  cut_by_slab(ray->ox, ray->dx, world->meshes_low[0], world->meshes_high[0], &enter, &leave);
  cut_by_slab(ray->oy, ray->dy, world->meshes_low[1], world->meshes_high[1], &enter, &leave);
  cut_by_slab(ray->oz, ray->dz, world->meshes_low[2], world->meshes_high[2], &enter, &leave);
  return enter <= leave;
}

/* meet_meshes - triangles nearer than what was hit so far. */
INLINE void meet_meshes(const shapes_t *shapes, const pathv *ray, realv least, maskv active,
                        shape_hitv *hit) {
  lanesv_t at[8];
  at[0].all = ray->ox, at[1].all = ray->oy, at[2].all = ray->oz;
  at[3].all = ray->dx, at[4].all = ray->dy, at[5].all = ray->dz;
  realv most = hit->distance * COINCIDENT;
  active = active & may_meet_meshes(shapes->world, ray, least, most);
  if (!any_lane(active)) return;
  at[6].all = least, at[7].all = active ? most : (realv)-1;
  for (int i = 0; i < WIDTH; ++i) {
    if (!(at[7].lane[i] > 0)) continue;
    mesh_hit_t found = {at[7].lane[i], -1, 0, 0};
    int object;
    mesh_hit_of_lane(shapes, at[0].lane[i], at[1].lane[i], at[2].lane[i], at[3].lane[i],
                     at[4].lane[i], at[5].lane[i], at[6].lane[i], &found, &object);
    if (object < 0) continue;
    LANE(hit->distance, i) = found.distance;
    LANE(hit->object, i) = object;
    LANE(hit->triangle, i) = found.triangle;
    LANE(hit->u, i) = found.u;
    LANE(hit->v, i) = found.v;
  }
}
#endif

/* first_hit - what rays meet first beyond `least`; of two things in one place the earlier object. */
SEARCHING void first_hit(const shapes_t *shapes, const pathv *ray, realv least, maskv active,
                      shape_hitv *hit) {
  hit->distance = (realv)INFINITY;
  hit->object = hit->triangle = (intv)(-1);
  hit->u = hit->v = (realv)0;
  realv distance;
#if HAS_FLATS
  for (int i = 0; i < shapes->world->n_flats; ++i) {
    realv u, v;
    maskv here = flat_hit(shapes->flats + i, ray, &distance, &u, &v);
    here = here & (distance > least) & (distance < hit->distance * COINCIDENT);
    hit->distance = here ? distance : hit->distance;
    hit->object = select_int(here, (intv)shapes->flats[i].object, hit->object);
    hit->u = here ? u : hit->u;
    hit->v = here ? v : hit->v;
  }
#endif
#if HAS_BALLS
  for (int i = 0; i < shapes->world->n_balls; ++i) {
    maskv here = ball_hit(shapes->balls + i, ray, least, &distance);
    here = here & (distance > least) & (distance < hit->distance * COINCIDENT);
    hit->distance = here ? distance : hit->distance;
    hit->object = select_int(here, (intv)shapes->balls[i].object, hit->object);
  }
#endif
  hit->object = select_int(active, hit->object, (intv)(-1));
#if HAS_MESHES
  meet_meshes(shapes, ray, least, active, hit);
#endif
}

#if HAS_CUTOUTS || HAS_ADDITIVE
/* beyond - where balls and triangles are looked for behind a surface at a distance. */
INLINE realv beyond(realv distance) {
  return mul_add(distance, (realv)(1 + 4 * ROUNDING), (realv)R(1e-12));
}

/* hit_behind - what rays meet behind a surface of object `after` at the distance `passed`.
 *
 * Flat shapes in one place are met one after the other, in the order of the objects.
 */
SHARED void hit_behind(const shapes_t *shapes, const pathv *ray, realv passed, intv after,
                       maskv active, shape_hitv *hit) {
  realv far = beyond(passed);
  first_hit(shapes, ray, far, active, hit);
#if HAS_FLATS
  for (int i = 0; i < shapes->world->n_flats; ++i) {
    const int object = shapes->flats[i].object;
    realv distance, u, v;
    maskv here = active & flat_hit(shapes->flats + i, ray, &distance, &u, &v);
    maskv is_next = mask_from_int((intv)object > after) & (distance > passed * COINCIDENT);
    here = here & (is_next | (distance * COINCIDENT > passed)) & (distance > 0);
    here = here & (distance <= far) & (distance < hit->distance * COINCIDENT);
    hit->distance = here ? distance : hit->distance;
    hit->object = select_int(here, (intv)object, hit->object);
    hit->triangle = select_int(here, (intv)(-1), hit->triangle);
    hit->u = here ? u : hit->u;
    hit->v = here ? v : hit->v;
  }
#endif
}
#endif

/* is_hidden - whether anything lies on rays before `most`. */
INLINE maskv is_hidden(const shapes_t *shapes, const pathv *ray, realv most, maskv active) {
  realv distance;
  maskv hidden = !active;
#if HAS_FLATS
  for (int i = 0; i < shapes->world->n_flats; ++i) {
    realv u, v;
    maskv here = flat_hit(shapes->flats + i, ray, &distance, &u, &v);
    hidden = hidden | (here & (distance > 0) & (distance < most));
  }
#endif
#if HAS_BALLS
  for (int i = 0; i < shapes->world->n_balls; ++i) {
    maskv here = ball_hit(shapes->balls + i, ray, (realv)0, &distance);
    hidden = hidden | (here & (distance > 0) & (distance < most));
  }
#endif
#if HAS_MESHES
  lanesv_t at[7];
  at[0].all = ray->ox, at[1].all = ray->oy, at[2].all = ray->oz;
  at[3].all = ray->dx, at[4].all = ray->dy, at[5].all = ray->dz;
  at[6].all = !hidden & may_meet_meshes(shapes->world, ray, (realv)0, most) ? most : (realv)-1;
  if (!any_lane(at[6].all > 0)) return hidden;
  for (int i = 0; i < WIDTH; ++i) {
    if (!(at[6].lane[i] > 0)) continue;
    const int is_met =
        mesh_hides_lane(shapes, at[0].lane[i], at[1].lane[i], at[2].lane[i], at[3].lane[i],
                        at[4].lane[i], at[5].lane[i], at[6].lane[i]);
    at[6].lane[i] = is_met ? -2 : at[6].lane[i];
  }
  hidden = hidden | (at[6].all == -2);
#endif
  return hidden;
}

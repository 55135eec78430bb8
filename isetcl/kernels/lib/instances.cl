/* instances.cl - meshes that stand in many places: a hierarchy of instances over those of meshes.
 *
 * A leaf of the upper hierarchy is a block of eight instances; empty places have object -1. Rays are
 * taken into the frame of the mesh with directions as long as the map makes them, so that distances
 * stay those of the world.
 */
#include "lib/bvh.cl"

/* ray_into - a ray in the frame of an instance's mesh. */
INLINE void ray_into(global const instance_t *instance, real ox, real oy, real oz, real dx, real dy,
                     real dz, mesh_ray_t *ray) {
  global const real *m = instance->inverse;
  mesh_ray(ox * m[0] + oy * m[1] + oz * m[2] + m[3], ox * m[4] + oy * m[5] + oz * m[6] + m[7],
           ox * m[8] + oy * m[9] + oz * m[10] + m[11], dx * m[0] + dy * m[1] + dz * m[2],
           dx * m[4] + dy * m[5] + dz * m[6], dx * m[8] + dy * m[9] + dz * m[10], ray);
}

/* closest_instance - the nearest triangle of all instances beyond `least` and before found. */
INLINE void closest_instance(constant world_t *world, global const instance_t *instances,
                             global const real8 *nodes, global const real8 *blocks, real ox,
                             real oy, real oz, real dx, real dy, real dz, real least,
                             mesh_hit_t *found, int *object) {
  global const real8 *upper = nodes + (size_t)world->instances_at * NODE_VECTORS;
  mesh_ray_t ray;
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  ulong stack[STACK_SIZE];
  int used = 0, at = 0;
  for (;;) {
    if (at < 0) {
      global const instance_t *block = instances + (size_t)(-1 - at) * 8;
      for (int i = 0; i < 8 && block[i].object >= 0; ++i) {
        mesh_ray_t inner;
        ray_into(block + i, ox, oy, oz, dx, dy, dz, &inner);
        mesh_hit_t one = {found->distance, -1, 0, 0};
        closest_hit(&inner, nodes + (size_t)block[i].nodes_at * NODE_VECTORS,
                    blocks + (size_t)block[i].blocks_at * BLOCK_VECTORS, least, &one);
        if (one.triangle < 0) continue;
        *found = one;
        found->triangle += block[i].first_triangle;
        *object = block[i].object;
      }
    } else {
      global const real8 *node = upper + (size_t)at * NODE_VECTORS;
      global const int *child = (global const int *)(node + NODE_REFERENCES);
      lanes8_t entered;
      ulong lanes = enter_node(&ray, node, least, found->distance, &entered);
      const int base = used;
      while (lanes) {
        const int lane = first_lane(lanes);
        lanes &= lanes - 1;
        const ulong entry = entry_of(entered.lane[lane], child[lane]);
        int j = used++;
        for (; j > base && stack[j - 1] < entry; --j) stack[j] = stack[j - 1];
        stack[j] = entry;
      }
    }
    do {
      if (used == 0) return;
      --used;
    } while (entered_at(stack[used]) >= found->distance);
    at = (int)(uint)stack[used];
  }
}

/* any_instance - whether any triangle of an instance lies before `most`. */
INLINE int any_instance(constant world_t *world, global const instance_t *instances,
                        global const real8 *nodes, global const real8 *blocks, real ox, real oy,
                        real oz, real dx, real dy, real dz, real most) {
  global const real8 *upper = nodes + (size_t)world->instances_at * NODE_VECTORS;
  mesh_ray_t ray;
  mesh_ray(ox, oy, oz, dx, dy, dz, &ray);
  int stack[STACK_SIZE];
  int used = 0, at = 0;
  for (;;) {
    if (at < 0) {
      global const instance_t *block = instances + (size_t)(-1 - at) * 8;
      for (int i = 0; i < 8 && block[i].object >= 0; ++i) {
        mesh_ray_t inner;
        ray_into(block + i, ox, oy, oz, dx, dy, dz, &inner);
        if (any_hit(&inner, nodes + (size_t)block[i].nodes_at * NODE_VECTORS,
                    blocks + (size_t)block[i].blocks_at * BLOCK_VECTORS, 0, most))
          return 1;
      }
    } else {
      global const real8 *node = upper + (size_t)at * NODE_VECTORS;
      global const int *child = (global const int *)(node + NODE_REFERENCES);
      lanes8_t entered;
      ulong lanes = enter_node(&ray, node, 0, most, &entered);
      while (lanes) {
        stack[used++] = child[first_lane(lanes)];
        lanes &= lanes - 1;
      }
    }
    if (used == 0) return 0;
    at = stack[--used];
  }
}

/* bvh.cl - closest hit and any hit of one ray with a mesh in an eight-wide hierarchy.
 *
 * One ray a work-item: its path through the tree is its own. The eight children of a node, and the
 * eight triangles of a leaf, are tested at once in explicit vectors.
 */
#include "lib/real.cl"

/* A node is lo and hi of x, y, z in turn (real8), then its eight references (int8), then padding: 8
 * vectors in single, 7 in double precision. A block of eight triangles is x, y, z of the corners a,
 * b, c in turn, then their numbers, then padding: 10 vectors.
 */
#define NODE_REFERENCES 6
#define BLOCK_VECTORS 10
#define BLOCK_NUMBERS 9
#if DOUBLE_PRECISION
#define NODE_VECTORS 7
#define ROUNDING 4.44e-16 /* two units in the last place */
#else
#define NODE_VECTORS 8
#define ROUNDING 2.4e-7f
#endif

/* Lanes of a vector by number. */
typedef union {
  real8 all;
  real lane[8];
} lanes8_t;

/* A ray as the tree is asked about it. */
typedef struct {
  /* For a plane x = p: entered at p * inverse + enter, left at p * inverse + leave. */
  real ix, iy, iz;
  real enter_x, enter_y, enter_z, leave_x, leave_y, leave_z;
  /* 1 where the ray runs towards smaller coordinates and enters through the upper plane. */
  int from_x, from_y, from_z;
  /* The steepest axis and the other two; the shear and scale that turn the ray into (0, 0, 1). */
  int main, first, second;
  real main_o, first_o, second_o, shear_first, shear_second, scale;
} mesh_ray_t;

/* What a ray hit: distance in units of its direction, triangle (-1: nothing), weights of b and c. */
typedef struct {
  real distance;
  int triangle;
  real u, v;
} mesh_hit_t;

/* slab_constants - the constants of one axis.
 *
 * Rounding of o * inverse may be as large as the box is thick; entering earlier and leaving later
 * by that much makes the test conservative at no cost in the loop. A direction of zero becomes so
 * steep that a box is missed only by rays 1e-9 m outside it, also where the ray lies in a face.
 */
INLINE void slab_constants(real o, real d, real *inverse, real *enter, real *leave, int *from) {
  const real size = d < 0 ? -d : d;
  const int is_flat = size < R(1e-18);
  const real i = is_flat ? R(1e24) : 1 / size;
  *from = d < 0;
  *inverse = d < 0 ? -i : i;
  const real at = -o * *inverse;
  const real slack = (at < 0 ? -at : at) * ROUNDING + (is_flat ? R(1e15) : 0);
  *enter = at - slack;
  *leave = at + slack;
}

/* mesh_ray - prepares a ray for the tree. */
INLINE void mesh_ray(real ox, real oy, real oz, real dx, real dy, real dz, mesh_ray_t *ray) {
  const real x = dx < 0 ? -dx : dx, y = dy < 0 ? -dy : dy, z = dz < 0 ? -dz : dz;
  if (x > y && x > z) {
    ray->main = 0, ray->first = 1, ray->second = 2;
    ray->main_o = ox, ray->first_o = oy, ray->second_o = oz;
    ray->scale = 1 / dx, ray->shear_first = dy / dx, ray->shear_second = dz / dx;
  } else if (y > z) {
    ray->main = 1, ray->first = 2, ray->second = 0;
    ray->main_o = oy, ray->first_o = oz, ray->second_o = ox;
    ray->scale = 1 / dy, ray->shear_first = dz / dy, ray->shear_second = dx / dy;
  } else {
    ray->main = 2, ray->first = 0, ray->second = 1;
    ray->main_o = oz, ray->first_o = ox, ray->second_o = oy;
    ray->scale = 1 / dz, ray->shear_first = dx / dz, ray->shear_second = dy / dz;
  }
  slab_constants(ox, dx, &ray->ix, &ray->enter_x, &ray->leave_x, &ray->from_x);
  slab_constants(oy, dy, &ray->iy, &ray->enter_y, &ray->leave_y, &ray->from_y);
  slab_constants(oz, dz, &ray->iz, &ray->enter_z, &ray->leave_z, &ray->from_z);
}

/* lanes_of - the lanes where a comparison of real8 is true, one bit a byte, lane 0 lowest. */
INLINE ulong lanes_of(real_bits8 condition) {
#if CPU_BUILTINS
  return __builtin_astype(__builtin_convertvector(condition, char8), ulong) & 0x0101010101010101ul;
#else
  return as_ulong(convert_char8(condition)) & 0x0101010101010101ul;
#endif
}

/* first_lane - the lowest lane in a non-zero mask. */
INLINE int first_lane(ulong lanes) {
#if CPU_BUILTINS
  return __builtin_ctzl(lanes) >> 3;
#else
  return (63 - (int)clz(lanes & (0 - lanes))) >> 3;
#endif
}

INLINE void fetch_ahead(global const real8 *at) {
#if CPU_BUILTINS
  const char *line = (const char *)(size_t)at;
  __builtin_prefetch(line);
  __builtin_prefetch(line + 64);
  __builtin_prefetch(line + 128);
  __builtin_prefetch(line + 192);
#endif
}

#if CPU_BUILTINS
#define fused8(a, b, c) ((a) * (b) + (c))
#else
#define fused8(a, b, c) fma(a, b, c)
#endif

/* cross2 - a b' - a' b, with the sign of the exact value: Kahan's difference of products. */
INLINE real8 cross2(real8 a, real8 b, real8 a2, real8 b2) {
  const real8 product = a2 * b;
  const real8 error = fused8(-a2, b, product);
  const real8 difference = fused8(a, b2, -product);
  return difference + error;
}

/* hit_block - the nearest of eight triangles between `least` and hit->distance.
 *
 * The ray is sheared to run along the main axis through (0, 0); a triangle is hit where all its edges
 * see that point on the same side. Corners are rounded once, alike for every triangle that has
 * them, and the sides are exact for the rounded corners. So no ray slips between triangles, neither
 * at an edge nor at a corner, and those without area are never hit.
 *
 * Returns whether any was hit.
 * Source: Woop, Benthin & Wald (2013), "Watertight ray/triangle intersection", JCGT 2(1), here with
 * Kahan's products in place of a fallback to double precision.
 */
INLINE int hit_block(const mesh_ray_t *ray, global const real8 *block, real least,
                     mesh_hit_t *hit) {
  const int f = ray->first, s = ray->second, m = ray->main;
  const real8 az = block[m] - ray->main_o, bz = block[3 + m] - ray->main_o,
              cz = block[6 + m] - ray->main_o;
  const real8 ax = (block[f] - ray->first_o) - ray->shear_first * az;
  const real8 ay = (block[s] - ray->second_o) - ray->shear_second * az;
  const real8 bx = (block[3 + f] - ray->first_o) - ray->shear_first * bz;
  const real8 by = (block[3 + s] - ray->second_o) - ray->shear_second * bz;
  const real8 cx = (block[6 + f] - ray->first_o) - ray->shear_first * cz;
  const real8 cy = (block[6 + s] - ray->second_o) - ray->shear_second * cz;
  const real8 w = cross2(cx, cy, bx, by);
  const real8 u = cross2(ax, ay, cx, cy);
  const real8 v = cross2(bx, by, ax, ay);
  const real_bits8 inside =
      ((u >= 0) & (v >= 0) & (w >= 0)) | ((u <= 0) & (v <= 0) & (w <= 0));
  if (!lanes_of(inside)) return 0;
  lanes8_t distance, of_b, of_c, sum;
  sum.all = u + v + w;
  distance.all = (w * az + u * bz + v * cz) * ray->scale / sum.all;
  ulong lanes = lanes_of(inside & (sum.all != 0) & (distance.all > least) &
                         (distance.all < hit->distance));
  if (!lanes) return 0;
  of_b.all = u;
  of_c.all = v;
  global const int *numbers = (global const int *)(block + BLOCK_NUMBERS);
  do {
    const int lane = first_lane(lanes);
    lanes &= lanes - 1;
    if (distance.lane[lane] < hit->distance) {
      hit->distance = distance.lane[lane];
      hit->triangle = numbers[lane];
      hit->u = of_b.lane[lane] / sum.lane[lane];
      hit->v = of_c.lane[lane] / sum.lane[lane];
    }
  } while (lanes);
  return 1;
}

/* An entry of the stack: where a child is entered, as bits that order like distances, and the child. */
INLINE ulong entry_of(real entered, int child) {
#if DOUBLE_PRECISION
  return (ulong)as_uint((float)(entered * 0.999999)) << 32 | (uint)child;
#else
  return (ulong)as_uint(entered) << 32 | (uint)child;
#endif
}
INLINE real entered_at(ulong entry) { return as_float((uint)(entry >> 32)); }

/* exchange - puts the farther of two entries first. */
INLINE void exchange(ulong *a, ulong *b) {
  const ulong far = *a > *b ? *a : *b, near = *a > *b ? *b : *a;
  *a = far;
  *b = near;
}

/* enter_node - which children of a node a ray meets between `least` and `most`, and where. */
INLINE ulong enter_node(const mesh_ray_t *ray, global const real8 *node, real least, real most,
                        lanes8_t *entered) {
  const real8 x = node[ray->from_x] * ray->ix + ray->enter_x;
  const real8 y = node[2 + ray->from_y] * ray->iy + ray->enter_y;
  const real8 z = node[4 + ray->from_z] * ray->iz + ray->enter_z;
  const real8 far_x = node[1 - ray->from_x] * ray->ix + ray->leave_x;
  const real8 far_y = node[3 - ray->from_y] * ray->iy + ray->leave_y;
  const real8 far_z = node[5 - ray->from_z] * ray->iz + ray->leave_z;
  const real8 xy = x > y ? x : y, z0 = z > least ? z : (real8)least;
  const real8 far_xy = far_x < far_y ? far_x : far_y;
  const real8 left = (far_xy < far_z ? far_xy : far_z) * (1 + ROUNDING);
  entered->all = xy > z0 ? xy : z0;
  return lanes_of(entered->all <= (left < most ? left : (real8)most));
}

/* closest_hit - the nearest triangle of a mesh beyond `least` and before hit->distance. */
INLINE void closest_hit(const mesh_ray_t *ray, global const real8 *nodes,
                        global const real8 *blocks, real least, mesh_hit_t *hit) {
  ulong stack[STACK_SIZE];
  int used = 0, at = 0;
  for (;;) {
    if (at < 0) {
      hit_block(ray, blocks + (size_t)(-1 - at) * BLOCK_VECTORS, least, hit);
    } else {
      global const real8 *node = nodes + (size_t)at * NODE_VECTORS;
      global const int *child = (global const int *)(node + NODE_REFERENCES);
      lanes8_t entered;
      ulong lanes = enter_node(ray, node, least, hit->distance, &entered);
      if (lanes) {
        int lane = first_lane(lanes);
        lanes &= lanes - 1;
        if (!lanes) {
          at = child[lane];
          continue;
        }
        /* Push the children met, the nearest last. */
        int base = used;
        do {
          const int next = child[lane];
          fetch_ahead(next < 0 ? blocks + (size_t)(-1 - next) * BLOCK_VECTORS
                               : nodes + (size_t)next * NODE_VECTORS);
          stack[used++] = entry_of(entered.lane[lane], next);
          if (!lanes) break;
          lane = first_lane(lanes);
          lanes &= lanes - 1;
        } while (1);
        ulong *met = stack + base;
        switch (used - base) {
          case 2:
            exchange(met, met + 1);
            break;
          case 3:
            exchange(met, met + 1);
            exchange(met, met + 2);
            exchange(met + 1, met + 2);
            break;
          case 4:
            exchange(met, met + 1);
            exchange(met + 2, met + 3);
            exchange(met, met + 2);
            exchange(met + 1, met + 3);
            exchange(met + 1, met + 2);
            break;
          default:
            for (int i = base + 1; i < used; ++i) {
              const ulong entry = stack[i];
              int j = i;
              for (; j > base && stack[j - 1] < entry; --j) stack[j] = stack[j - 1];
              stack[j] = entry;
            }
        }
        at = (int)(uint)stack[--used];
        continue;
      }
    }
    /* Go on with the nearest entry that can still hold something nearer. */
    do {
      if (used == 0) return;
      --used;
    } while (entered_at(stack[used]) >= hit->distance);
    at = (int)(uint)stack[used];
  }
}

/* any_hit - whether any triangle lies beyond `least` and before `most`. */
INLINE int any_hit(const mesh_ray_t *ray, global const real8 *nodes, global const real8 *blocks,
                   real least, real most) {
  int stack[STACK_SIZE];
  int used = 0, at = 0;
  mesh_hit_t hit = {most, -1, 0, 0};
  for (;;) {
    if (at < 0) {
      if (hit_block(ray, blocks + (size_t)(-1 - at) * BLOCK_VECTORS, least, &hit)) return 1;
    } else {
      global const real8 *node = nodes + (size_t)at * NODE_VECTORS;
      global const int *child = (global const int *)(node + NODE_REFERENCES);
      lanes8_t entered;
      ulong lanes = enter_node(ray, node, least, most, &entered);
      while (lanes) {
        stack[used++] = child[first_lane(lanes)];
        lanes &= lanes - 1;
      }
    }
    if (used == 0) return 0;
    at = stack[--used];
  }
}

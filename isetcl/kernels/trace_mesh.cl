/* trace_mesh.cl - rays and a triangle mesh: what each hits first, or whether it hits anything. */
#include "lib/bvh.cl"

/* trace_mesh - closest hits of n rays.
 *
 * origin, direction   planes x, y, z of n values; the direction need not have length one
 * range               planes least, most: hits in between count, in units of the direction's length
 * nodes, blocks       the hierarchy, see lib/bvh.cl
 * distance            out: +infinity where nothing is hit
 * triangle            out: number of the triangle, or -1
 * weights             out: planes of the weights of its second and third corner
 */
kernel void trace_mesh(const int n, global const real *restrict origin,
                       global const real *restrict direction, global const real *restrict range,
                       global const real8 *restrict nodes, global const real8 *restrict blocks,
                       global real *restrict distance, global int *restrict triangle,
                       global real *restrict weights) {
  const int i = get_global_id(0);
  if (i >= n) return;
  mesh_ray_t ray;
  mesh_ray(origin[i], origin[n + i], origin[2 * n + i], direction[i], direction[n + i],
           direction[2 * n + i], &ray);
  mesh_hit_t hit = {range[n + i], -1, 0, 0};
  closest_hit(&ray, nodes, blocks, range[i], &hit);
  distance[i] = hit.triangle < 0 ? INFINITY : hit.distance;
  triangle[i] = hit.triangle;
  weights[i] = hit.u;
  weights[n + i] = hit.v;
}

/* occlude_mesh - whether anything lies in the range of each of n rays. */
kernel void occlude_mesh(const int n, global const real *restrict origin,
                         global const real *restrict direction, global const real *restrict range,
                         global const real8 *restrict nodes, global const real8 *restrict blocks,
                         global int *restrict occluded) {
  const int i = get_global_id(0);
  if (i >= n) return;
  mesh_ray_t ray;
  mesh_ray(origin[i], origin[n + i], origin[2 * n + i], direction[i], direction[n + i],
           direction[2 * n + i], &ray);
  occluded[i] = any_hit(&ray, nodes, blocks, range[i], range[n + i]);
}

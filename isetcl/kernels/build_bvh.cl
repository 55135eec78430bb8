/* build_bvh.cl - a binary tree over boxes by binned SAH, made by one work-item of a CPU.
 *
 * A single core of a CPU is faster at this than numpy by a factor of ten, and nothing else in a
 * render can begin before it; a GPU never runs it.  The same rules as build_binary_tree in
 * isetcl/scene/bvh.py.
 */
#include "lib/real.cl"

#define BINS 16

INLINE real4 least4(real4 a, real4 b) { return a < b ? a : b; }
INLINE real4 most4(real4 a, real4 b) { return a > b ? a : b; }

/* box_area - half the surface of a box. */
INLINE real box_area(real4 lo, real4 hi) {
  real4 d = hi - lo;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

/* build_bvh - nodes of the tree; node 0 is the root, the children of a node are neighbours.
 *
 * lo, hi      bounds of n boxes, the fourth component 0
 * order       out: box numbers, those of a leaf side by side
 * node_lo, node_hi   out: bounds of the nodes, at most 2 n - 1
 * node_range  out: (first place in order, count) of a leaf, (left child, 0) of an inner node
 * n_nodes     out: how many there are
 *
 * The smaller part of a split is done first, so that 32 entries of the stack are enough.
 */
kernel void build_bvh(const int n, global const real4 *restrict lo, global const real4 *restrict hi,
                      global int *restrict order, global real4 *restrict node_lo,
                      global real4 *restrict node_hi, global int2 *restrict node_range,
                      global int *n_nodes) {
  int4 stack[34]; /* node, first, count, depth */
  real4 bin_lo[3][BINS], bin_hi[3][BINS];
  int bin_count[3][BINS];
  for (int i = 0; i < n; ++i) order[i] = i;
  int made = 1, depth_of_stack = 0;
  stack[depth_of_stack++] = (int4)(0, 0, n, 0);
  while (depth_of_stack > 0) {
    const int4 job = stack[--depth_of_stack];
    const int first = job.y, count = job.z, last = job.y + job.z;
    /* Bound the boxes and their centres (twice the centre, as no one minds the factor). */
    real4 all_lo = (real4)(INFINITY), all_hi = (real4)(-INFINITY);
    real4 centre_lo = (real4)(INFINITY), centre_hi = (real4)(-INFINITY);
    for (int i = first; i < last; ++i) {
      const real4 a = lo[order[i]], b = hi[order[i]], c = a + b;
      all_lo = least4(all_lo, a);
      all_hi = most4(all_hi, b);
      centre_lo = least4(centre_lo, c);
      centre_hi = most4(centre_hi, c);
    }
    node_lo[job.x] = all_lo;
    node_hi[job.x] = all_hi;
    if (count <= LEAF_SIZE) {
      node_range[job.x] = (int2)(first, count);
      continue;
    }
    /* Sort the boxes into bins along every axis. */
    const real4 extent = centre_hi - centre_lo;
    const real4 scale = extent > 0 ? BINS / extent : (real4)(0);
    int best_axis = -1, best_bin = 0, left = 0;
    if (job.w < SAH_DEPTH) {
      for (int axis = 0; axis < 3; ++axis)
        for (int b = 0; b < BINS; ++b) {
          bin_lo[axis][b] = (real4)(INFINITY);
          bin_hi[axis][b] = (real4)(-INFINITY);
          bin_count[axis][b] = 0;
        }
      for (int i = first; i < last; ++i) {
        const real4 a = lo[order[i]], b = hi[order[i]];
        const real4 slot = (a + b - centre_lo) * scale;
        const int slots[3] = {(int)slot.x, (int)slot.y, (int)slot.z};
#pragma unroll
        for (int axis = 0; axis < 3; ++axis) {
          const int s = slots[axis] < BINS - 1 ? slots[axis] : BINS - 1;
          bin_lo[axis][s] = least4(bin_lo[axis][s], a);
          bin_hi[axis][s] = most4(bin_hi[axis][s], b);
          ++bin_count[axis][s];
        }
      }
      /* Cut after the bin where area times number, summed over both sides, is least. */
      real best = INFINITY;
      for (int axis = 0; axis < 3; ++axis) {
        real cost_right[BINS];
        real4 a = (real4)(INFINITY), b = (real4)(-INFINITY);
        int number = 0;
        for (int s = BINS - 1; s > 0; --s) {
          number += bin_count[axis][s];
          a = least4(a, bin_lo[axis][s]);
          b = most4(b, bin_hi[axis][s]);
          cost_right[s] = number > 0 ? number * box_area(a, b) : INFINITY;
        }
        a = (real4)(INFINITY), b = (real4)(-INFINITY);
        number = 0;
        for (int s = 0; s < BINS - 1; ++s) {
          number += bin_count[axis][s];
          a = least4(a, bin_lo[axis][s]);
          b = most4(b, bin_hi[axis][s]);
          const real cost = number > 0 ? number * box_area(a, b) + cost_right[s + 1] : INFINITY;
          if (cost < best) best = cost, best_axis = axis, best_bin = s, left = number;
        }
      }
    }
    /* Bring the boxes of the left child to the front. */
    if (best_axis < 0) {
      left = count / 2;
    } else {
      const real start = best_axis == 0 ? centre_lo.x : best_axis == 1 ? centre_lo.y : centre_lo.z;
      const real step = best_axis == 0 ? scale.x : best_axis == 1 ? scale.y : scale.z;
      int i = first, j = last - 1;
      while (i <= j) {
        const int box = order[i];
        const real4 c = lo[box] + hi[box];
        const real at = best_axis == 0 ? c.x : best_axis == 1 ? c.y : c.z;
        const int s = (int)((at - start) * step);
        if ((s < BINS - 1 ? s : BINS - 1) <= best_bin) {
          ++i;
        } else {
          order[i] = order[j];
          order[j] = box;
          --j;
        }
      }
      left = i - first;
    }
    node_range[job.x] = (int2)(made, 0);
    const int4 one = (int4)(made, first, left, job.w + 1);
    const int4 other = (int4)(made + 1, first + left, count - left, job.w + 1);
    made += 2;
    stack[depth_of_stack++] = left < count - left ? other : one;
    stack[depth_of_stack++] = left < count - left ? one : other;
  }
  *n_nodes = made;
}

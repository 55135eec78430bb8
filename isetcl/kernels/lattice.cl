/* lattice.cl - points that push each other into a lattice of given spacing, and choosing some of
 * them that keep their distance.
 *
 * Everything is gathered: a work-item reads all points and writes its own, in an order that depends
 * on the points alone, so that results are the same to the last bit for work-groups of any size.
 *
 * Points are sorted into cells. The plane is divided into square tiles of one size, every tile into
 * its own number of square cells, so that a cell holds about as many points in dense parts as in
 * sparse ones. Coordinates are mm from the middle of the patch: in float they are good to 1e-7 of
 * its width, a nanometre for a centimetre.
 */
#include "lib/real.cl"

#if !CPU_BUILTINS
#if DOUBLE_PRECISION
typedef double2 real2;
#else
typedef float2 real2;
#endif
#endif

/* first_cell - number of the tile or cell along one axis that holds a coordinate, within 0..n-1. */
INLINE int first_cell(real offset, real per_mm, int n) {
  const int cell = whole(offset * per_mm);
  return cell < 0 ? 0 : (cell >= n ? n - 1 : cell);
}

/* FOR_POINTS_NEAR - a loop over j, all points of the cells that touch the square |x - p| <= reach.
 *
 * origin      lower left corner of the tiles, mm
 * tile_mm     width of a tile, mm; columns, rows   how many there are
 * tile_first  first cell of each tile; tile_cells   its cells along one axis
 * cell_first  first point of each cell, and of one more
 */
#define FOR_POINTS_NEAR(p, reach)                                                                 \
  const int tx0 = first_cell(p.x - reach - origin.x, 1 / tile_mm, columns);                       \
  const int tx1 = first_cell(p.x + reach - origin.x, 1 / tile_mm, columns);                       \
  const int ty0 = first_cell(p.y - reach - origin.y, 1 / tile_mm, rows);                          \
  const int ty1 = first_cell(p.y + reach - origin.y, 1 / tile_mm, rows);                          \
  for (int ty = ty0; ty <= ty1; ++ty)                                                             \
    for (int tx = tx0; tx <= tx1; ++tx) {                                                         \
      const int tile = ty * columns + tx, n_cells = tile_cells[tile];                             \
      const real per_mm = (real)n_cells / tile_mm;                                                \
      const real left = origin.x + (real)tx * tile_mm, low = origin.y + (real)ty * tile_mm;       \
      const int cx0 = first_cell(p.x - reach - left, per_mm, n_cells);                            \
      const int cx1 = first_cell(p.x + reach - left, per_mm, n_cells);                            \
      const int cy0 = first_cell(p.y - reach - low, per_mm, n_cells);                             \
      const int cy1 = first_cell(p.y + reach - low, per_mm, n_cells);                             \
      for (int cy = cy0; cy <= cy1; ++cy) {                                                       \
        const int row = tile_first[tile] + cy * n_cells;                                          \
        const int last = cell_first[row + cx1 + 1];                                               \
        for (int j = cell_first[row + cx0]; j < last; ++j)

#define END_POINTS_NEAR }}

#define TILES                                                                                     \
  const real2 origin, const real tile_mm, const int columns, const int rows,                      \
      global const int *restrict tile_first, global const int *restrict tile_cells,               \
      global const int *restrict cell_first

/* find_neighbours - for every point the others that may come within reach of it.
 *
 * n, places   the points, mm
 * size        wanted distance of each to its neighbours, mm
 * reach       how far neighbours are looked for, in sizes
 * neighbour   out: [MOST][n], numbers of the others; of more than MOST the first are kept
 * n_neighbours   out: how many
 */
kernel void find_neighbours(const int n, global const real2 *restrict places,
                            global const real *restrict size, const real reach, TILES,
                            global int *restrict neighbour, global int *restrict n_neighbours) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const real2 p = places[i];
  const real radius = reach * size[i];
  int found = 0;
  FOR_POINTS_NEAR(p, radius) {
    const real2 d = places[j] - p;
    if (j != i && d.x * d.x + d.y * d.y < radius * radius && found < MOST)
      neighbour[(size_t)n * found++ + i] = j;
  }
  END_POINTS_NEAR
  n_neighbours[i] = found;
}

/* push - one step of all points under their neighbours' repulsion.
 *
 *     x_i += step sum_j max(range l_ij - d, 0) (x_i - x_j) / d,   l_ij = (size_i + size_j) / 2
 *
 * The force of a bar that is too short, none of one that is too long: Persson & Strang 2004. In
 * equilibrium force over length, and so length over size, is the same everywhere. No point moves by
 * more than FARTHEST of its size at once.
 *
 * is_fixed    points that do not move
 * moved       out: the new places, mm
 */
kernel void push(const int n, global const real2 *restrict places, global const real *restrict size,
                 global const uchar *restrict is_fixed, const real range, const real step,
                 global const int *restrict neighbour, global const int *restrict n_neighbours,
                 global real2 *restrict moved) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const real2 p = places[i];
  const real own = size[i];
  real2 sum = (real2)(0);
  const int found = is_fixed[i] ? 0 : n_neighbours[i];
  for (int k = 0; k < found; ++k) {
    const int j = neighbour[(size_t)n * k + i];
    const real2 d = p - places[j];
    const real length = scalar_root(d.x * d.x + d.y * d.y);
    const real excess = range * R(0.5) * (own + size[j]) - length;
    /* Two points in one place have no direction; their neighbours part them. */
    if (excess > 0 && length > 0) sum += d * (excess / length);
  }
  sum *= step;
  const real length = scalar_root(sum.x * sum.x + sum.y * sum.y);
  const real farthest = FARTHEST * own;
  if (length > farthest) sum *= farthest / length;
  moved[i] = p + sum;
}

#define UNDECIDED 0
#define CHOSEN 1
#define REFUSED 2

/* choose_apart - one round of choosing points that keep their distance, by rank.
 *
 * A point is chosen when all points of lower rank within its distance are refused, and refused when
 * one of them is chosen: what comes out is what taking the points one by one in the order of their
 * ranks would give, whatever the order of the work-items.
 *
 * rank        a permutation of 0..n-1
 * distance    the least distance to other chosen points, mm; between two, the smaller one counts
 * state       UNDECIDED, CHOSEN or REFUSED
 * next        out: the states after this round
 * n_left      out: [n], 1 where a point is still undecided
 */
kernel void choose_apart(const int n, global const real2 *restrict places,
                         global const int *restrict rank, global const real *restrict distance,
                         global const int *restrict state, TILES, global int *restrict next,
                         global int *restrict n_left) {
  const int i = get_global_id(0);
  if (i >= n) return;
  int own = state[i];
  if (own == UNDECIDED) {
    const real2 p = places[i];
    const real radius = distance[i];
    const int order = rank[i];
    int waits = 0, refused = 0;
    FOR_POINTS_NEAR(p, radius) {
      const real2 d = places[j] - p;
      const real least = radius < distance[j] ? radius : distance[j];
      if (rank[j] < order && d.x * d.x + d.y * d.y < least * least) {
        waits |= state[j] == UNDECIDED;
        refused |= state[j] == CHOSEN;
      }
    }
    END_POINTS_NEAR
    own = refused ? REFUSED : (waits ? UNDECIDED : CHOSEN);
  }
  next[i] = own;
  n_left[i] = own == UNDECIDED;
}

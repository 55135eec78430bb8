/* cone_excitations.cl - what receptors catch of a retinal image, at places that may move. */
#include "lib/real.cl"

/* Columns of edges held at once; wider apertures are taken in strips. */
#define STRIP 32

#if HAS_GAUSSIAN
/* share_below - share of a Gaussian below x, whose 1/e radius is 1, cut off at +-REACH. */
#define REACH R(2.6)
INLINE real share_below(real x) { return R(0.5) * erf(clamp(x, -REACH, REACH)); }
#else
#define REACH R(1.0)
/* segment_area - (x sqrt(1 - x^2) + asin x) / 2: a quarter of the unit disc's area at most. */
INLINE real segment_area(real x) {
  real inside = clamp(x, -R(1.0), R(1.0));
  return R(0.5) * (inside * sqrt(fmax(R(0.0), 1 - inside * inside)) + asin(inside));
}

/* corner_area - area of the unit disc to the left of x and below y.
 *
 * hx, hy   segment_area of x and y: area left of x is 2 hx + pi / 2
 */
INLINE real corner_area(real x, real y, real hx, real hy) {
  const real quarter = R(0.78539816339744830962);
  x = clamp(x, -R(1.0), R(1.0));
  y = clamp(y, -R(1.0), R(1.0));
  if (x * x + y * y < 1)
    return x * y + hx + hy + quarter;
  if (x < 0)
    return y < 0 ? 0 : 2 * (hx + quarter);
  return y < 0 ? 2 * (hy + quarter) : 2 * (hx + hy);
}
#endif

/* corner - share of the aperture to the left of x and below y, times a constant.
 *
 * of_x, of_y   segment_area, or share_below, of x and y
 */
INLINE real corner(real x, real y, real of_x, real of_y) {
#if HAS_GAUSSIAN
  return of_x * of_y;
#else
  return corner_area(x, y, of_x, of_y);
#endif
}

INLINE real of_edge(real x) {
#if HAS_GAUSSIAN
  return share_below(x);
#else
  return segment_area(x);
#endif
}

/* add_strip - adds the irradiance of a strip of columns, weighted by the share of the aperture.
 *
 * The share of a pixel is that of its four corners, taken in and out.
 *
 * row0, row1, col0, col1   pixels [first, end); at most STRIP columns
 * x, y, half_x, half_y     middle and semi-axes of the aperture, pixels from the image's corner
 * sum                      in and out: BLOCKS times 8 wavelengths
 *
 * Returns the sum of the weights.
 */
INLINE real add_strip(global const real8 *restrict irradiance, int columns, int row0, int row1,
                      int col0, int col1, real x, real y, real half_x, real half_y, real8 *sum) {
  real edge[STRIP + 1], weight_of[STRIP + 1], above[STRIP + 1];
  const int n = col1 - col0;
  real weights = 0;
  for (int i = 0; i <= n; ++i) {
    edge[i] = ((col0 + i) - x) / half_x;
    weight_of[i] = of_edge(edge[i]);
  }
  for (int row = row0; row <= row1; ++row) {
    const real v = (row - y) / half_y;
    const real of_v = of_edge(v);
    real above_left = above[0], left = corner(edge[0], v, weight_of[0], of_v);
    above[0] = left;
    global const real8 *pixel = irradiance + BLOCKS * ((size_t)(row - 1) * columns + col0);
    for (int i = 1; i <= n; ++i) {
      const real here = corner(edge[i], v, weight_of[i], of_v);
      const real weight = (here - left) - (above[i] - above_left);
      above_left = above[i];
      above[i] = left = here;
      if (row == row0)
        continue;
      weights += weight;
      for (int b = 0; b < BLOCKS; ++b)
        sum[b] += weight * pixel[(i - 1) * BLOCKS + b];
    }
  }
  return weights;
}

/* cone_excitations - excitations of receptors with the image moved by each of some shifts.
 *
 * The spectral irradiance averaged over the aperture, exactly in area, by the receptor's efficiency.
 *
 * irradiance   rows x columns x 8 BLOCKS wavelengths
 * apertures    of each receptor: column, row of its middle, semi-axes along both; pixels
 * efficiency   of each receptor, 8 BLOCKS: excitations per unit of irradiance
 * shifts       of each frame: columns, rows by which apertures move over the image
 * excitations  out: frames x receptors
 */
kernel void cone_excitations(global const real8 *restrict irradiance, const int rows,
                             const int columns, global const real4 *restrict apertures,
                             global const real8 *restrict efficiency,
                             global const real *restrict shifts, const int n_receptors,
                             global real *restrict excitations) {
  const size_t receptor = get_global_id(0), frame = get_global_id(1);
  if (receptor >= (size_t)n_receptors)
    return;
  const real4 aperture = apertures[receptor];
  const real x = aperture.x + shifts[2 * frame], y = aperture.y + shifts[2 * frame + 1];
  /* A border that rounds to the next pixel must not leave an aperture without any. */
  const int row0 = clamp((int)floor(y - REACH * aperture.w), 0, rows - 1);
  const int row1 = min(rows, (int)floor(y + REACH * aperture.w) + 1);
  const int first = clamp((int)floor(x - REACH * aperture.z), 0, columns - 1);
  const int end = min(columns, (int)floor(x + REACH * aperture.z) + 1);
  real8 sum[BLOCKS];
  for (int b = 0; b < BLOCKS; ++b)
    sum[b] = 0;
  real weights = 0;
  for (int col = first; col < end; col += STRIP)
    weights += add_strip(irradiance, columns, row0, row1, col, min(end, col + STRIP), x, y,
                         aperture.z, aperture.w, sum);
  real8 caught = 0;
  for (int b = 0; b < BLOCKS; ++b)
    caught += sum[b] * efficiency[receptor * BLOCKS + b];
  const real4 part = caught.lo + caught.hi;
  excitations[frame * n_receptors + receptor] =
      ((part.x + part.y) + (part.z + part.w)) / weights;
}

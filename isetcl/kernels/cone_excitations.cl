/* cone_excitations.cl - what receptors catch of a retinal image, at places that may move.
 *
 * Lanes are frames that lie near each other. Light depends on the place in the image and the
 * receptor alone, so that the spectrum of a pixel is summed once for all lanes; what differs among
 * them is the share of the aperture that lies in the pixel.
 */
#include "lib/real.cl"

/* Columns of edges held at once; wider apertures are taken in strips. */
#define STRIP 16

#if DOUBLE_PRECISION
#define MARGIN 1e-12   /* pixels */
#define ROUNDING 1e-15 /* of the aperture */
#else
#define MARGIN 4e-6f
#define ROUNDING 3e-7f
#endif

typedef struct {
  realv at;     /* the edge from the middle of the aperture, semi-axes, cut off where it ends */
  realv square; /* of it */
  realv rest;   /* disc: pi/4 - |area of the unit disc between 0 and the edge, above the axis| */
} edge_t;

#if HAS_GAUSSIAN
/* share_below - share of a Gaussian between 0 and x, whose 1/e radius is 1, cut off at +-REACH.
 *
 * erf(x) / (2 x) by a Chebyshev fit in x^2: float 7e-9, double 4e-17.
 */
#define REACH R(2.6)
INLINE realv share_below(realv x) {
  const realv z = x * x - R(3.38);
#if DOUBLE_PRECISION
  realv p = -1.0925340318646998423e-20;
  p = mul_add(p, z, (realv)2.2358027760527910434e-19);
  p = mul_add(p, z, (realv)-3.735885394817034279e-18);
  p = mul_add(p, z, (realv)6.8070694270917272348e-17);
  p = mul_add(p, z, (realv)-1.1880393081590894359e-15);
  p = mul_add(p, z, (realv)1.9358076666773411385e-14);
  p = mul_add(p, z, (realv)-2.9632239749824171477e-13);
  p = mul_add(p, z, (realv)4.2497776887240709443e-12);
  p = mul_add(p, z, (realv)-5.6835280458156512921e-11);
  p = mul_add(p, z, (realv)7.0539857347182282333e-10);
  p = mul_add(p, z, (realv)-8.0818860102026176203e-9);
  p = mul_add(p, z, (realv)8.4972952192154129024e-8);
  p = mul_add(p, z, (realv)-8.1453622629070678545e-7);
  p = mul_add(p, z, (realv)7.0694459055225746749e-6);
  p = mul_add(p, z, (realv)-5.5171852815349910856e-5);
  p = mul_add(p, z, (realv)3.8506410008623449211e-4);
  p = mul_add(p, z, (realv)-2.4021723384153136827e-3);
  p = mul_add(p, z, (realv)1.3585054866127977348e-2);
  p = mul_add(p, z, (realv)-7.4029460135063635227e-2);
  p = mul_add(p, z, (realv)0.53885758912817952006);
#else
  realv p = -6.79128679611e-11f;
  p = mul_add(p, z, (realv)8.66169921572e-10f);
  p = mul_add(p, z, (realv)-7.93557887292e-9f);
  p = mul_add(p, z, (realv)8.28419354589e-8f);
  p = mul_add(p, z, (realv)-8.1541398933e-7f);
  p = mul_add(p, z, (realv)7.08225206079e-6f);
  p = mul_add(p, z, (realv)-5.51694868812e-5f);
  p = mul_add(p, z, (realv)3.85029552371e-4f);
  p = mul_add(p, z, (realv)-2.40217466265e-3f);
  p = mul_add(p, z, (realv)1.35850888191e-2f);
  p = mul_add(p, z, (realv)-7.4029459766e-2f);
  p = mul_add(p, z, (realv)0.538857583737f);
#endif
  return R(0.5) * x * p;
}
#else
#define REACH R(1.0)
#define QUARTER R(0.78539816339744830962)
/* rest_of_quarter - area of the unit disc's quarter beyond u = 1 - |x|.
 *
 * (arccos|x| - |x| sqrt(1 - x^2)) / 2 = u^(3/2) g(u), g by a Chebyshev fit: float 3e-10, double
 * 5e-17.
 */
INLINE realv rest_of_quarter(realv u) {
#if DOUBLE_PRECISION
  realv g = -5.4285904688895125263e-7;
  g = mul_add(g, u, (realv)3.3937653547143142159e-6);
  g = mul_add(g, u, (realv)-1.0267053300134126629e-5);
  g = mul_add(g, u, (realv)1.879592015711805024e-5);
  g = mul_add(g, u, (realv)-2.3765408214043310852e-5);
  g = mul_add(g, u, (realv)2.054979877623033273e-5);
  g = mul_add(g, u, (realv)-1.4750653102461813589e-5);
  g = mul_add(g, u, (realv)3.6624626498266875347e-6);
  g = mul_add(g, u, (realv)-9.9194205405082684483e-6);
  g = mul_add(g, u, (realv)-2.0350346014581572332e-5);
  g = mul_add(g, u, (realv)-6.0531156654629706036e-5);
  g = mul_add(g, u, (realv)-1.858990523060362164e-4);
  g = mul_add(g, u, (realv)-6.2775931639281859012e-4);
  g = mul_add(g, u, (realv)-2.4552318202239257306e-3);
  g = mul_add(g, u, (realv)-1.2626906808463657096e-2);
  g = mul_add(g, u, (realv)-0.1414213562372931805);
  g = mul_add(g, u, (realv)0.9428090415820633376);
#else
  realv g = -6.18605290355e-5f;
  g = mul_add(g, u, (realv)1.19988748061e-4f);
  g = mul_add(g, u, (realv)-2.27558390882e-4f);
  g = mul_add(g, u, (realv)-7.76693105392e-5f);
  g = mul_add(g, u, (realv)-6.6756009828e-4f);
  g = mul_add(g, u, (realv)-2.4471820119e-3f);
  g = mul_add(g, u, (realv)-1.26277103679e-2f);
  g = mul_add(g, u, (realv)-0.141421325714f);
  g = mul_add(g, u, (realv)0.942809041393f);
#endif
  return u * square_root(u) * g;
}
#endif

/* edge_at - an edge at x semi-axes from the middle. */
INLINE void edge_at(realv x, edge_t *edge) {
  const realv inside = larger(smaller(x, (realv)REACH), (realv)-REACH);
#if HAS_GAUSSIAN
  edge->at = share_below(inside);
  edge->square = edge->rest = 0;
#else
  edge->at = inside;
  edge->square = inside * inside;
  edge->rest = rest_of_quarter(1 - magnitude(inside));
#endif
}

/* corner - share of the aperture to the left of x and below y, times a constant, less what depends
 * on x alone or y alone: the share of a pixel is that of its corners, taken in and out.
 *
 * Disc: x y inside; outside +-(pi/4 - rest of x - rest of y), which is where the disc ends.
 */
INLINE realv corner(const edge_t *x, const edge_t *y) {
  const realv inside = x->at * y->at;
#if HAS_GAUSSIAN
  return inside;
#else
  const realv outside = QUARTER - x->rest - y->rest;
  return x->square + y->square < 1 ? inside : inside < 0 ? -outside : outside;
#endif
}

/* light_of - the light of a pixel that the receptor catches. */
INLINE real light_of(global const real8 *pixel, const real8 *efficiency) {
  real8 caught = pixel[0] * efficiency[0];
  for (int b = 1; b < BLOCKS; ++b) caught += pixel[b] * efficiency[b];
  const real4 part = caught.lo + caught.hi;
  return (part.x + part.y) + (part.z + part.w);
}

/* cone_excitations - excitations of receptors with the image moved by each of some shifts.
 *
 * The spectral irradiance averaged over the aperture, exactly in area, by the receptor's efficiency.
 * Places are whole pixels and a rest, so that they are as exact far from the image's corner.
 *
 * irradiance   rows x columns x 8 BLOCKS wavelengths
 * apertures    of each receptor: rest of the column, of the row of its middle, semi-axes; pixels
 * corners      of each receptor: whole column, row of its middle
 * efficiency   of each receptor, 8 BLOCKS: excitations per unit of irradiance
 * origins      of each group of WIDTH frames: whole column, row of its least shift
 * reach        of each group: least and greatest shift from there along columns and along rows
 * shifts       of each group, lane by lane: whole columns, whole rows, their rests
 * frames       of each group, lane by lane: number of the frame; some may be the same
 * order        receptors in the order to take them in: neighbours look at the same pixels
 * excitations  out: frames x receptors
 */
kernel void cone_excitations(global const real8 *restrict irradiance, const int rows,
                             const int columns, global const real4 *restrict apertures,
                             global const int2 *restrict corners,
                             global const real8 *restrict efficiencies,
                             global const int2 *restrict origins, global const real4 *restrict reach,
                             global const real *restrict shifts, global const int *restrict frames,
                             global const int *restrict order, const int n_receptors,
                             global real *restrict excitations) {
  const size_t group = get_global_id(0), turn = get_global_id(1);
  if (turn >= (size_t)n_receptors)
    return;
  const size_t receptor = order[turn];
  const real4 aperture = apertures[receptor], span = reach[group];
  const int2 at = corners[receptor] + origins[group];
  /* What rounding may move beyond an edge must not be lost. */
  const real half_x = aperture.z * REACH + MARGIN, half_y = aperture.w * REACH + MARGIN;
  const int first_col = (int)floor(aperture.x + span.x - half_x);
  const int first_row = (int)floor(aperture.y + span.z - half_y);
  const int end_col = (int)floor(aperture.x + span.y + half_x) + 1;
  const int end_row = (int)floor(aperture.y + span.w + half_y) + 1;
  const realv whole_x = load_lanes(shifts, 4 * group), whole_y = load_lanes(shifts, 4 * group + 1);
  const realv x = aperture.x + load_lanes(shifts, 4 * group + 2);
  const realv y = aperture.y + load_lanes(shifts, 4 * group + 3);
  const real per_x = 1 / aperture.z, per_y = 1 / aperture.w;
  /* Less of an aperture than this is rounding: pixels that it does not reach must not count. */
  const real least = fmin(ROUNDING, R(1e-3) * per_x * per_y);
  real8 efficiency[BLOCKS];
  for (int b = 0; b < BLOCKS; ++b) efficiency[b] = efficiencies[receptor * BLOCKS + b];
  realv light = 0, shares = 0;
  for (int begin = first_col; begin < end_col; begin += STRIP) {
    edge_t edge[STRIP + 1];
    realv above[STRIP];
    const int n = min(STRIP, end_col - begin);
    for (int i = 0; i <= n; ++i) edge_at(((begin + i) - whole_x - x) * per_x, &edge[i]);
    for (int row = first_row; row <= end_row; ++row) {
      edge_t below;
      edge_at((row - whole_y - y) * per_y, &below);
      global const real8 *line =
          irradiance + BLOCKS * (size_t)clamp(at.y + row - 1, 0, rows - 1) * columns;
      realv left = corner(&edge[0], &below);
      /* Sums of rows first: many small parts one by one would be rounded away. */
      realv row_light = 0, row_shares = 0;
      for (int i = 0; i < n; ++i) {
        const realv right = corner(&edge[i + 1], &below);
        const realv width = right - left;
        left = right;
        if (row > first_row) {
          const int column = clamp(at.x + begin + i, 0, columns - 1);
          realv share = width - above[i];
          share = share > least ? share : (realv)0;
          row_shares += share;
          row_light += share * light_of(line + BLOCKS * column, efficiency);
        }
        above[i] = width;
      }
      light += row_light;
      shares += row_shares;
    }
  }
  light /= shares;
#if WIDTH == 1
  excitations[(size_t)frames[group] * n_receptors + receptor] = light;
#else
  for (int lane = 0; lane < WIDTH; ++lane)
    excitations[(size_t)frames[group * WIDTH + lane] * n_receptors + receptor] = light[lane];
#endif
}

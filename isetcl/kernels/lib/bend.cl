/* bend.cl - directions that change at random inside an eye: diffraction at its stop, and scatter.
 *
 * What a kernel draws is described in isetcl/eye/bending/ray_bending.py and people/scatter.py. The
 * numbers lie in the eye's table: at `element->bend` of the stop, BEND_* of them for each band.
 */
#include "lib/disc.cl"
#include "lib/frame.cl"
#include "lib/logarithm.cl"
#include "lib/ray.cl"
#include "lib/sobol.cl"

/* drawv - a random direction in a plane and, of a random size, the share that is larger. */
typedef struct {
  realv x, y, beyond;
} drawv;

/* bendsv - what is drawn for a ray's way through the eye. */
typedef struct {
#if HAS_DIFFRACTION
  drawv diffraction;
#endif
#if HAS_SCATTER
  drawv scatter;
#endif
  int unused;
} bendsv;

/* draw - a direction and a share from a point of the unit square, continuously. */
INLINE void draw(realv u, realv v, drawv *drawn) {
  realv radius, cosine, sine;
  concentric_ray(u, v, &radius, &cosine, &sine);
  drawn->x = radius < 0 ? -cosine : cosine;
  drawn->y = radius < 0 ? -sine : sine;
  /* At the very corner of the square nothing is left; what is bent so far is lost anyway. */
  drawn->beyond = larger((1 - radius) * (1 + radius), (realv)R(0x1p-32));
}

/* draw_bends - the random numbers of a sample; none where nothing bends. */
INLINE void draw_bends(uint sample, uintv pixel_stream, bendsv *bends) {
#if HAS_DIFFRACTION
  draw(sobol_coordinate(sample, 4, pixel_stream), sobol_coordinate(sample, 5, pixel_stream),
       &bends->diffraction);
#endif
#if HAS_SCATTER
  draw(sobol_coordinate(sample, 6, pixel_stream), sobol_coordinate(sample, 7, pixel_stream),
       &bends->scatter);
#endif
  bends->unused = 0;
}

/* table_between - a table at places between its n entries, linearly. */
INLINE realv table_between(global const real *table, int n, realv place) {
  realv last = (realv)(real)(n - 2);
  intv cell = int_from_real(place < last ? place : last);
  lanesv_t low, high;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) {
    global const real *at = table + LANE(cell, i);
    low.lane[i] = at[0];
    high.lane[i] = at[1];
  }
  return mul_add(place - real_from_int(cell), high.all - low.all, low.all);
}

#if HAS_DIFFRACTION
/* diffract - bends rays in the plane of the stop.
 *
 * T + scale M^T tau in the plane; |T| stays. What would exceed |T| is evanescent.
 *
 * ray     on the stop
 * bend    the stop's numbers for this band
 *
 * Returns the rays that go on.
 */
INLINE maskv diffract(rayv *ray, global const real *bend, const drawv *drawn, real sense) {
#if DIFFRACTION_AIRY
  /* x = sqrt((1 - t) / t), t the share beyond: the table's coordinate. */
  realv t = drawn->beyond;
  realv place = square_root((1 - t) / t) * bend[BEND_STEPS];
  const int nodes = AIRY_NODES;
  global const real *table = bend + (int)bend[BEND_TABLE];
  realv v = table_between(table, nodes, place);
  v = place < nodes - 1 ? v : R(0.63661977236758134308) / t;
  realv tau_x = v * drawn->x, tau_y = v * drawn->y;
#else
  realv dx = ray->x - bend[BEND_CENTRE_X], dy = ray->y - bend[BEND_CENTRE_Y];
  realv px = mul_add((realv)bend[BEND_XX], dx, bend[BEND_XY] * dy);
  realv py = mul_add((realv)bend[BEND_YX], dx, bend[BEND_YY] * dy);
  realv r = square_root(mul_add(px, px, py * py));
  realv sx = r > 0 ? px / r : (realv)1, sy = r > 0 ? py / r : (realv)0;
  realv across = 1 - r;
#if HURB_AXES == HURB_ISET3D
  realv along = square_root(across * (1 + r));
#elif HURB_AXES == HURB_OPTRACE
  realv along = square_root(across);
#else
  realv along = across;
#endif
  /* Two normal deviates: a Rayleigh radius in a random direction. */
  realv size = square_root(R(-2.0) * natural_log(drawn->beyond));
  realv gs = size * drawn->x / across, gl = size * drawn->y / along;
  realv tau_x = mul_add(gs, sx, -gl * sy), tau_y = mul_add(gs, sy, gl * sx);
#endif
  const real scale = bend[BEND_SCALE];
  realv n2 = mul_add(ray->tx, ray->tx, mul_add(ray->ty, ray->ty, ray->tz * ray->tz));
  ray->tx = mul_add((realv)scale, mul_add((realv)bend[BEND_XX], tau_x, bend[BEND_YX] * tau_y),
                    ray->tx);
  ray->ty = mul_add((realv)scale, mul_add((realv)bend[BEND_XY], tau_x, bend[BEND_YY] * tau_y),
                    ray->ty);
  realv along2 = n2 - mul_add(ray->tx, ray->tx, ray->ty * ray->ty);
  ray->tz = sense * square_root(along2);
  return along2 > 0;
}
#endif

#if HAS_SCATTER
/* scatter - turns a share of the rays that have left the eye, by an angle of their own.
 *
 * The published functions are of angles in front of the eye. The table holds tan(angle / 2) at even
 * steps of the share of scattered light that is turned less.
 */
INLINE void scatter(rayv *ray, global const real *bend, const drawv *drawn) {
  const real fraction = bend[BEND_FRACTION];
  realv share = 1 - drawn->beyond / fraction;
  maskv turned = share >= 0;
  realv place = (turned ? share : (realv)0) * (SCATTER_NODES - 1);
  realv half_tangent = table_between(bend + (int)bend[BEND_SCATTER_TABLE], SCATTER_NODES, place);
  half_tangent = turned ? half_tangent : (realv)0;
  realv h2 = half_tangent * half_tangent;
  realv inverse = 1 / (1 + h2);
  realv n = square_root(mul_add(ray->tx, ray->tx, mul_add(ray->ty, ray->ty, ray->tz * ray->tz)));
  framev frame;
  frame_of(ray->tx / n, ray->ty / n, ray->tz / n, &frame);
  realv sine = 2 * half_tangent * inverse;
  vec3v inner = {sine * drawn->x, sine * drawn->y, (1 - h2) * inverse}, world;
  to_world(&frame, &inner, &world);
  ray->tx = n * world.x;
  ray->ty = n * world.y;
  ray->tz = n * world.z;
}
#endif

/* form.cl - surfaces of any shape in the frame of their vertex. */
#include "lib/biconic.cl"
#include "lib/even_asphere.cl"
#include "lib/height_map.cl"
#include "lib/quadric.cl"
#include "lib/toric.cl"
#include "lib/zernike_sag.cl"

/* Many shapes make a long function; with one or two a copy in each place is a third faster. */
#if HAS_BICONICS + HAS_TORICS + HAS_EVEN_ASPHERES + HAS_ZERNIKE_SAGS + HAS_HEIGHT_MAPS > 2
#define SEARCH SHARED
#else
#define SEARCH INLINE
#endif

/* How far off a surface, squared and times 4, mm^2, a ray may be left by a search; farther off it
 * has missed. Five times the rounding of a search in single precision; in double as on the host.
 */
#if DOUBLE_PRECISION
#define SQUARE_OFF_SURFACE 1e-20
#else
#define SQUARE_OFF_SURFACE 4e-10f
#endif

/* form_implicit - S and g of a surface at a point of its own frame. */
INLINE void form_implicit(realv x, realv y, realv z, constant element_t *s,
                          global const real *eye_table, slopev *slope) {
#if HAS_BICONICS
  if (s->shape == SHAPE_BICONIC) {
    biconic_implicit(x, y, z, s, slope);
    return;
  }
#endif
#if HAS_TORICS
  if (s->shape == SHAPE_TORIC) {
    toric_implicit(x, y, z, s, slope);
    return;
  }
#endif
#if HAS_DEPARTURES
  global const real *table = eye_table + s->table;
  departurev departure = {0, 0, 0};
#if HAS_EVEN_ASPHERES
  if (s->shape == SHAPE_EVEN_ASPHERE) even_asphere_departure(x, y, s, table, &departure);
#endif
#if HAS_ZERNIKE_SAGS
  if (s->shape == SHAPE_ZERNIKE_SAG) zernike_sag_departure(x, y, s, table, &departure);
#endif
#if HAS_HEIGHT_MAPS
  if (s->shape == SHAPE_HEIGHT_MAP) height_map_departure(x, y, s, table, &departure);
#endif
  departure_implicit(x, y, z, s, &departure, slope);
#else
  quadric_implicit(x, y, z, s, slope);
#endif
}

/* form_search - moves rays from the quadric nearest to a surface onto it, by Newton's method.
 *
 * A fixed number of steps, s->steps: lanes stay together and rays independent of their neighbours.
 *
 * ray     rays on the quadric
 * at out  path (added to), q, g and |g|^2
 *
 * A ray that misses, or would cross against its direction of travel, becomes NaN.
 */
SEARCH void form_search(rayv *ray, constant element_t *s, global const real *eye_table, real sense,
                        crossingv *at) {
  slopev slope;
  for (int i = 0;; ++i) {
    form_implicit(ray->x, ray->y, ray->z, s, eye_table, &slope);
    at->q = mul_add(slope.gx, ray->tx, mul_add(slope.gy, ray->ty, slope.gz * ray->tz));
    if (i == s->steps) break;
    const realv step = R(0.5) * slope.value / at->q;
    advance(ray, step);
    at->path += step;
  }
  at->gx = slope.gx;
  at->gy = slope.gy;
  at->gz = slope.gz;
  at->g2 = mul_add(slope.gx, slope.gx, mul_add(slope.gy, slope.gy, slope.gz * slope.gz));
  const maskv landed = slope.exists & (slope.value * slope.value <= SQUARE_OFF_SURFACE * at->g2) &
                       (sense * at->q >= 0);
  ray->x = landed ? ray->x : (realv)NAN;
}

/* form_intersect - moves rays to a surface, crossed in the direction of travel.
 *
 * As conic_intersect; at also has g and |g|^2, in the surface's own frame.
 */
INLINE maskv form_intersect(rayv *ray, constant element_t *s, global const real *eye_table,
                            real sense, int far_side, crossingv *at) {
  rayv start = *ray;
  const realv before = at->path;
  maskv met = quadric_intersect(ray, s, sense, far_side, at);
#if HAS_SEARCHES
  if (s->steps > 0) {
    /* Where the quadric is missed, the plane of the vertex is as good a start as any. */
    const maskv is_met = is_number(ray->x);
    const realv to_plane = -start.z / start.tz;
    at->path = is_met ? at->path : before + to_plane;
    advance(&start, to_plane);
    ray->x = is_met ? ray->x : start.x;
    ray->y = is_met ? ray->y : start.y;
    ray->z = is_met ? ray->z : start.z;
    met = met | !is_met;
    form_search(ray, s, eye_table, sense, at);
    return met;
  }
#endif
  slopev slope;
  quadric_implicit(ray->x, ray->y, ray->z, s, &slope);
  at->gx = slope.gx;
  at->gy = slope.gy;
  at->gz = slope.gz;
  at->g2 = mul_add(slope.gx, slope.gx, mul_add(slope.gy, slope.gy, slope.gz * slope.gz));
  return met;
}

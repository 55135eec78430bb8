/* ray.cl - rays inside an eye, and where they cross its elements.
 *
 * A direction T is scaled to the index of the medium, |T| = n. Then neither the length of the
 * surface gradient nor a division by the index is needed at a refraction.
 */
#include "lib/real.cl"

/* HAS_SHAPES - whether any surface is not a conic of revolution about its own axis.
 * HAS_FORMS - whether any surface is not a conic of revolution about the axis of the eye.
 * HAS_GRADIENTS - whether the index of any medium changes from place to place.
 */
#define HAS_DEPARTURES (HAS_EVEN_ASPHERES || HAS_ZERNIKE_SAGS || HAS_HEIGHT_MAPS)
#define HAS_SEARCHES (HAS_BICONICS || HAS_TORICS || HAS_DEPARTURES)
#define HAS_SHAPES (HAS_QUADRICS || HAS_SEARCHES)
#define HAS_FORMS (HAS_SHAPES || HAS_PLACEMENTS)
#define HAS_GRADIENTS (HAS_POLYNOMIAL_GRADIENTS || HAS_SHELL_GRADIENTS)

/* rayv - WIDTH rays: a point (mm) and a direction of length n. */
typedef struct {
  realv x, y, z;
  realv tx, ty, tz;
} rayv;

/* squared_length - |T|^2. */
INLINE realv squared_length(const rayv *ray) {
  return mul_add(ray->tx, ray->tx, mul_add(ray->ty, ray->ty, ray->tz * ray->tz));
}

/* crossingv - where WIDTH rays cross an element.
 *
 * path       from the old point to the new one, in units of T
 * q          g . T, the sine-free part of Snell's law
 * gx, gy, gz, g2   slope g of the surface (towards +z) in the eye frame, and its square
 * ax, ay     the point in the element's own frame, as its aperture measures it, mm
 *
 * q is set at surfaces only, not at the stop; g, without HAS_FORMS, where a ray is refracted.
 */
typedef struct {
  realv path, q;
  realv gx, gy, gz, g2;
  realv ax, ay;
} crossingv;

/* slopev - an implicit equation S = 0 of a surface at points of its own frame.
 *
 * value      S, mm: twice the distance along the axis, near the vertex
 * gx, gy, gz   g = -grad S / 2
 * exists     lanes over which there is a surface at all
 */
typedef struct {
  realv value;
  realv gx, gy, gz;
  maskv exists;
} slopev;

/* approach_vertex - moves rays to their points of closest approach to the origin; returns the path.
 *
 * The distances that follow are short then, whatever the ray's own origin was.
 */
INLINE realv approach_vertex(rayv *ray, constant element_t *s) {
  const realv approach =
      -s->inverse_n2 * mul_add(ray->x, ray->tx, mul_add(ray->y, ray->ty, ray->z * ray->tz));
  ray->x = mul_add(approach, ray->tx, ray->x);
  ray->y = mul_add(approach, ray->ty, ray->y);
  ray->z = mul_add(approach, ray->tz, ray->z);
  return approach;
}

/* advance - moves rays along their directions. */
INLINE void advance(rayv *ray, realv path) {
  ray->x = mul_add(path, ray->tx, ray->x);
  ray->y = mul_add(path, ray->ty, ray->y);
  ray->z = mul_add(path, ray->tz, ray->z);
}

/* crossing_root - the root t of A t^2 - 2 F t + G = 0 that crosses in the direction of travel.
 *
 * It has g . T = q = sense sqrt(F^2 - A G); the discriminant is formed with Kahan's difference of
 * products. On the near side (F q >= 0, nearly all rays of nearly all eyes) the root is G / (F + q),
 * which does not cancel and makes A = 0 (plane, axis-parallel ray on a paraboloid) no special case;
 * on the far side it is (F - q) / A. NaN or infinite where there is none.
 *
 * sense     +1 towards the retina, -1 towards the scene
 * far_side  1: take the far-side root where it applies; 0: leave it out. A constant
 * q out     g . T
 * near_side out   the rays on the near side, or all if the far side is included
 *
 * Source: Feder 1951, J Opt Soc Am 41:630 (roots); W. Kahan (difference of products).
 */
INLINE realv crossing_root(realv f, realv g, realv a, real sense, int far_side, realv *q,
                           maskv *near_side) {
  realv product = a * g;
  realv rounding = mul_add(-a, g, product);
  realv discriminant = mul_add(f, f, -product);
  discriminant += rounding;
  *q = sense * square_root(discriminant);
  realv numerator = g;
  realv denominator = f + *q;
  *near_side = sense * f >= 0;
  if (far_side) {
    numerator = *near_side ? g : f - *q;
    denominator = *near_side ? denominator : a;
    /* A ray in the surface touches it where it is; 0 / 0 elsewhere is a miss, as x / 0 is. */
    denominator = (numerator == 0) ? (realv)1 : denominator;
    *near_side = -1;
  }
  return numerator / denominator;
}

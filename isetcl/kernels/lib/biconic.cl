/* biconic.cl - a conic section in x and another in y.
 *
 * z = N / (1 + w),  N = cx x^2 + cy y^2,  w = sqrt(1 - A),
 * A = (1 + kx) cx^2 x^2 + (1 + ky) cy^2 y^2.
 *
 * Source: Lian et al. 2019, J Vis 19(13):23, equation 1 (Zemax's "Biconic").
 */
#include "lib/ray.cl"

/* The least 1 - A of which a root is taken. Beyond the rim the surface goes on with this w, so that
 * a search that begins or strays there finds back.
 */
#define SMALLEST_RADICAND R(1e-12)

/* biconic_implicit - S = N - z (1 + w), and g. */
INLINE void biconic_implicit(realv x, realv y, realv z, constant element_t *s, slopev *slope) {
  const realv inside = 1 - mul_add(s->factor_x * x, x, s->factor_y * y * y);
  const realv w = square_root(larger(inside, (realv)SMALLEST_RADICAND));
  const realv bx = s->curvature_x * x, by = s->curvature * y;
  const realv lean = inside > SMALLEST_RADICAND ? z / (w + w) : (realv)0;
  slope->value = mul_add(bx, x, mul_add(by, y, -mul_add(z, w, z)));
  slope->gx = -mul_add(lean * s->factor_x, x, bx);
  slope->gy = -mul_add(lean * s->factor_y, y, by);
  slope->gz = mul_add((realv)R(0.5), w, (realv)R(0.5));
  slope->exists = inside >= 0;
}

/* toric.cl - an arc turned about an axis that does not pass through its centre.
 *
 * The y section, a conic of sag s(y), turned about an axis parallel to y at z = 1/cx:
 * cx (x^2 + z^2 - s^2) - 2 (z - s) = 0.
 */
#include "lib/biconic.cl"

/* toric_implicit - S, written as cx x^2 + (z - s) (cx (z + s) - 2), and g. */
INLINE void toric_implicit(realv x, realv y, realv z, constant element_t *s, slopev *slope) {
  const realv inside = 1 - s->factor_y * y * y;
  const realv w = square_root(larger(inside, (realv)SMALLEST_RADICAND));
  const realv by = s->curvature * y;
  const realv arc = by * y / (1 + w);
  slope->value = mul_add(s->curvature_x * x, x,
                         (z - arc) * mul_add((realv)s->curvature_x, z + arc, (realv)R(-2.0)));
  slope->gx = -s->curvature_x * x;
  /* Beyond the rim the arc goes on as the parabola 2 c y^2 / 2, w = 0. */
  const realv lean = inside > SMALLEST_RADICAND ? by / w : by + by;
  slope->gy = mul_add((realv)s->curvature_x, arc, (realv)R(-1.0)) * lean;
  slope->gz = mul_add((realv)-s->curvature_x, z, (realv)1);
  slope->exists = inside >= 0;
}

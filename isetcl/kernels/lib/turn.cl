/* turn.cl - angles in turns: sine and cosine of one, and the angle of a vector.
 */
#include "lib/real.cl"

/* sine_cosine_turn - sin and cos of 2 pi u, for 0 <= u <= 1. */
INLINE void sine_cosine_turn(realv u, realv *sine, realv *cosine) {
  realv quarters = mul_add((realv)4, u, (realv)R(0.5));
  intv quadrant = int_from_real(quarters);
  realv s, c;
  sine_cosine_quarter((4 * u - real_from_int(quadrant)) * R(1.57079632679489661923), &s, &c);
  maskv swapped = mask_from_int((quadrant & 1) != 0);
  realv a = swapped ? c : s, b = swapped ? s : c;
  *sine = mask_from_int((quadrant & 2) != 0) ? -a : a;
  *cosine = mask_from_int(((quadrant + 1) & 2) != 0) ? -b : b;
}

/* turn_of - the angle of (x, y) in turns, -1/2 to 1/2; 0 at the origin.
 *
 * Source: S. Moshier, Cephes atanf; 2e-7 relative in float. In double the polynomial of atan is
 * continued by one Newton step on tan through sine and cosine of the small angle.
 */
INLINE realv turn_of(realv y, realv x) {
  realv ax = magnitude(x), ay = magnitude(y);
  maskv steep = ay > ax;
  realv ratio = (steep ? ax : ay) / larger(steep ? ay : ax, (realv)R(1e-37));
  maskv upper = ratio > R(0.4142135623730950);
  realv t = upper ? (ratio - 1) / (ratio + 1) : ratio;
  realv z = t * t;
  realv p = mul_add((realv)R(8.05374449538e-2), z, (realv)R(-1.38776856032e-1));
  p = mul_add(p, z, (realv)R(1.99777106478e-1));
  p = mul_add(p, z, (realv)R(-3.33329491539e-1));
  realv angle = mul_add(p * z, t, t);
#if DOUBLE_PRECISION
  realv s, c;
  sine_cosine_quarter(angle, &s, &c);
  angle += (t * c - s) / mul_add(t, s, c);
#endif
  angle += upper ? (realv)R(0.78539816339744830962) : (realv)0;
  angle = steep ? R(1.57079632679489661923) - angle : angle;
  angle = x < 0 ? R(3.14159265358979323846) - angle : angle;
  angle = y < 0 ? -angle : angle;
  return angle * R(0.15915494309189533577);
}

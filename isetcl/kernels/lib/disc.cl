/* disc.cl - the unit square to the unit disc, area-preserving and continuous.
 */
#include "lib/real.cl"

/* concentric_ray - the same point as a radius in [-1, 1] along a direction of length 1. */
INLINE void concentric_ray(realv u, realv v, realv *radius, realv *along_x, realv *along_y) {
  realv a = mul_add((realv)2, u, (realv)-1);
  realv b = v - R(0.5);
  b = b + b;
  maskv wide = a * a - b * b > 0;
  realv most = wide ? a : b;
  realv other = wide ? b : a;
  realv sine, cosine;
  sine_cosine_quarter(other / (most == 0 ? (realv)1 : most) * R(0.78539816339744830962), &sine,
                      &cosine);
  *radius = most;
  *along_x = wide ? cosine : sine;
  *along_y = wide ? sine : cosine;
}

/* concentric_disc - a point of the unit disc from (u, v) in the unit square.
 *
 * Source: Shirley & Chiu 1997, J Graphics Tools 2(3):45.
 * The squares are compared instead of the magnitudes: two alike chains of operations would be
 * packed into two-lane vectors by some compilers and stop the wider vectorisation.
 */
INLINE void concentric_disc(realv u, realv v, realv *x, realv *y) {
  realv radius, along_x, along_y;
  concentric_ray(u, v, &radius, &along_x, &along_y);
  *x = radius * along_x;
  *y = radius * along_y;
}

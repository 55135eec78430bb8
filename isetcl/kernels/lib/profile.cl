/* profile.cl - an index of refraction that changes from place to place.
 *
 * A profile in the eye's table is GRADIENT_FRAME reals (the vertex of its frame from that of the
 * element; its three axes; 1 for shells) and its numbers: c[i][j] of z^i r^2j, GRADIENT_ROW a row;
 * or core, core - edge, centre, 1 / semi_z^2, 1 / semi_r^2, power - 1.
 */
#include "lib/ray.cl"
#if HAS_GRADIENTS
#if HAS_SHELL_GRADIENTS
#include "lib/power.cl"
#endif

#define GRADIENT_FRAME 13
#define GRADIENT_ROW (GRADIENT_DEGREE / 2 + 1)

#if HAS_POLYNOMIAL_GRADIENTS
/* polynomial_index - n and its derivatives by z and by s = r^2; mm. Horner's rule.
 *
 * The conditions are constants once the loops are unrolled.
 */
INLINE void polynomial_index(global const real *c, realv s, realv z, realv *n, realv *by_z,
                             realv *by_s) {
#pragma unroll
  for (int i = GRADIENT_DEGREE; i >= 0; --i) {
    const int last = (GRADIENT_DEGREE - i) / 2;
    realv value = c[i * GRADIENT_ROW + last], slope = 0;
#pragma unroll
    for (int j = GRADIENT_ROW - 2; j >= 0; --j) {
      if (j < last) {
        slope = j == last - 1 ? value : mul_add(slope, s, value);
        value = mul_add(value, s, (realv)c[i * GRADIENT_ROW + j]);
      }
    }
    *by_z = i == GRADIENT_DEGREE ? (realv)0
            : i == GRADIENT_DEGREE - 1 ? *n
                                       : mul_add(*by_z, z, *n);
    *n = i == GRADIENT_DEGREE ? value : mul_add(*n, z, value);
    if (i <= GRADIENT_DEGREE - 2)
      *by_s = i == GRADIENT_DEGREE - 2 ? slope : mul_add(*by_s, z, slope);
  }
}
#endif

#if HAS_SHELL_GRADIENTS
/* shell_power - (zeta^2)^(power - 1) and zeta^2 */
INLINE realv shell_power(global const real *p, realv s, realv z, realv *zeta2) {
  realv from_centre = z - p[2];
  *zeta2 = mul_add(from_centre * p[3], from_centre, s * p[4]);
#if HAS_REAL_POWERS
  return power_lanes(*zeta2, p[5]);
#else
  return whole_power(*zeta2, (int)p[5]);
#endif
}
#endif

/* index_force - half the gradient of n^2, 1/mm, at points of the profile's frame.
 *
 * Returns n^2.
 */
INLINE realv index_force(global const real *profile, realv x, realv y, realv z, realv *fx,
                           realv *fy, realv *fz) {
  global const real *p = profile + GRADIENT_FRAME;
  realv s = mul_add(x, x, y * y);
  realv n = 1, across = 0;
#if HAS_SHELL_GRADIENTS
#if HAS_POLYNOMIAL_GRADIENTS
  if (profile[GRADIENT_FRAME - 1] != 0)
#endif
  {
    realv zeta2;
    realv less = p[1] * shell_power(p, s, z, &zeta2);
    n = mul_add(-less, zeta2, (realv)p[0]);
    realv steep = R(-2.0) * (p[5] + 1) * n * less;
    across = steep * p[4];
    *fz = steep * p[3] * (z - p[2]);
  }
#if HAS_POLYNOMIAL_GRADIENTS
  else
#endif
#endif
#if HAS_POLYNOMIAL_GRADIENTS
  {
    realv by_z, by_s;
    polynomial_index(p, s, z, &n, &by_z, &by_s);
    across = (n + n) * by_s;
    *fz = n * by_z;
  }
#endif
  *fx = across * x;
  *fy = across * y;
  return n * n;
}

/* to_profile, from_profile - rays from the frame of an element to that of a profile and back. */
INLINE void to_profile(rayv *ray, global const real *profile) {
#if HAS_PLACED_GRADIENTS
  global const real *r = profile + 3;
  realv x = ray->x - profile[0], y = ray->y - profile[1], z = ray->z - profile[2];
  ray->x = mul_add(x, (realv)r[0], mul_add(y, (realv)r[1], z * r[2]));
  ray->y = mul_add(x, (realv)r[3], mul_add(y, (realv)r[4], z * r[5]));
  ray->z = mul_add(x, (realv)r[6], mul_add(y, (realv)r[7], z * r[8]));
  x = ray->tx, y = ray->ty, z = ray->tz;
  ray->tx = mul_add(x, (realv)r[0], mul_add(y, (realv)r[1], z * r[2]));
  ray->ty = mul_add(x, (realv)r[3], mul_add(y, (realv)r[4], z * r[5]));
  ray->tz = mul_add(x, (realv)r[6], mul_add(y, (realv)r[7], z * r[8]));
#endif
}
INLINE void from_profile(rayv *ray, global const real *profile) {
#if HAS_PLACED_GRADIENTS
  global const real *r = profile + 3;
  realv x = ray->x, y = ray->y, z = ray->z;
  ray->x = mul_add(x, (realv)r[0], mul_add(y, (realv)r[3], mul_add(z, (realv)r[6], profile[0])));
  ray->y = mul_add(x, (realv)r[1], mul_add(y, (realv)r[4], mul_add(z, (realv)r[7], profile[1])));
  ray->z = mul_add(x, (realv)r[2], mul_add(y, (realv)r[5], mul_add(z, (realv)r[8], profile[2])));
  x = ray->tx, y = ray->ty, z = ray->tz;
  ray->tx = mul_add(x, (realv)r[0], mul_add(y, (realv)r[3], z * r[6]));
  ray->ty = mul_add(x, (realv)r[1], mul_add(y, (realv)r[4], z * r[7]));
  ray->tz = mul_add(x, (realv)r[2], mul_add(y, (realv)r[5], z * r[8]));
#endif
}
#endif

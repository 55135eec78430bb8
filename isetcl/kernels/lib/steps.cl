/* steps.cl - steps of rays through a gradient of the index.
 *
 * Ray equation in t with ds = n dt:  R'' = grad(n^2) / 2,  T = R' = n times the unit direction: the
 * state of a ray everywhere in the eye.  Source: Sharma, Kumar & Ghatak 1982, Appl Opt 21:984.
 */
#include "lib/profile.cl"
#if HAS_GRADIENTS

/* stagesv - half the gradient of n^2 and n^2 itself at the stages of a step. */
typedef struct {
  realv fx[4], fy[4], fz[4], n2[4];
} stagesv;

/* look - fills stage i at R + reach T + h2 (bx, by, bz). */
INLINE void look(stagesv *stages, int i, const rayv *ray, global const real *profile, realv reach,
                 realv h2, realv bx, realv by, realv bz) {
  stages->n2[i] = index_force(profile, mul_add(h2, bx, mul_add(reach, ray->tx, ray->x)),
                              mul_add(h2, by, mul_add(reach, ray->ty, ray->y)),
                              mul_add(h2, bz, mul_add(reach, ray->tz, ray->z)), stages->fx + i,
                              stages->fy + i, stages->fz + i);
}

INLINE realv sum_of_2(const realv *f, real a, real b) { return mul_add(f[0], (realv)a, f[1] * b); }
INLINE realv sum_of_3(const realv *f, real a, real b, real c) {
  return mul_add(f[0], (realv)a, mul_add(f[1], (realv)b, f[2] * c));
}

#if DOUBLE_PRECISION
/* gradient_step - one step of Gauss's collocation with three stages: order 6.
 *
 * Stages R_i = R + c_i h T + h^2 sum_j a_ij f_j with the square of the method's matrix (Nystroem).
 * They begin on the parabola of the force at h / 6 of the straight way, f + h f' / 6: that leaves
 * errors of h^3 (c^2 / 12 - c^3 / 6) f', which after one sweep cancel in T to order 7, because the
 * integral of (1 - c)^2 (c^2 / 12 - c^3 / 6) is 0.
 * Source: Hairer, Norsett & Wanner 1993, Solving ODEs I, II.7 and II.14.
 *
 * ray    in the profile's frame
 * h      step of t, mm
 *
 * Returns the optical path length, mm.
 */
INLINE realv gradient_step(rayv *ray, global const real *profile, realv h) {
  const real c[3] = {R(0.11270166537925831148), R(0.5), R(0.88729833462074168852)};
  const real b[3] = {R(0.27777777777777777778), R(0.44444444444444444444),
                     R(0.27777777777777777778)};
  const real a[3][3] = {
      {R(0.0111111111111111111), R(-0.00828851880460926412), R(0.00352824038312730875)},
      {R(0.102402546475103012), R(0.0277777777777777778), R(-0.00518032425288079007)},
      {R(0.218693981839094913), R(0.16384407436016482), R(0.0111111111111111111)}};
  const realv h2 = h * h;
  stagesv early, first, last;
  look(&early, 0, ray, profile, h * R(0.16666666666666666667), 0, 0, 0, 0);
#pragma unroll
  for (int i = 0; i < 3; ++i) {
    const real half_c2 = R(0.5) * c[i] * c[i];
    look(&first, i, ray, profile, h * c[i], h2, half_c2 * early.fx[0], half_c2 * early.fy[0],
         half_c2 * early.fz[0]);
  }
#pragma unroll
  for (int i = 0; i < 3; ++i)
    look(&last, i, ray, profile, h * c[i], h2, sum_of_3(first.fx, a[i][0], a[i][1], a[i][2]),
         sum_of_3(first.fy, a[i][0], a[i][1], a[i][2]),
         sum_of_3(first.fz, a[i][0], a[i][1], a[i][2]));
  /* b_i (1 - c_i) */
  const real w[3] = {b[0] * c[2], b[1] * R(0.5), b[2] * c[0]};
  ray->x = mul_add(h, mul_add(h, sum_of_3(last.fx, w[0], w[1], w[2]), ray->tx), ray->x);
  ray->y = mul_add(h, mul_add(h, sum_of_3(last.fy, w[0], w[1], w[2]), ray->ty), ray->y);
  ray->z = mul_add(h, mul_add(h, sum_of_3(last.fz, w[0], w[1], w[2]), ray->tz), ray->z);
  ray->tx = mul_add(h, sum_of_3(last.fx, b[0], b[1], b[2]), ray->tx);
  ray->ty = mul_add(h, sum_of_3(last.fy, b[0], b[1], b[2]), ray->ty);
  ray->tz = mul_add(h, sum_of_3(last.fz, b[0], b[1], b[2]), ray->tz);
  return h * sum_of_3(last.n2, b[0], b[1], b[2]);
}
#else
INLINE realv sum_of_4(const realv *f, real a, real b, real c, real d) {
  return mul_add(f[0], (realv)a, mul_add(f[1], (realv)b, mul_add(f[2], (realv)c, f[3] * d)));
}

/* gradient_step - one step of Nystroem's explicit method of order 5, with four looks at the index.
 *
 * Where single precision is enough it takes less work than Gauss's method with its seven.
 * Source: Hairer, Norsett & Wanner 1993, Solving ODEs I, II.14, table 14.2.
 *
 * ray    in the profile's frame
 * h      step of t, mm
 *
 * Returns the optical path length, mm.
 */
INLINE realv gradient_step(rayv *ray, global const real *profile, realv h) {
  const real a2[2] = {R(-0.037037037037037037), R(0.25925925925925925926)};
  const real a3[3] = {R(0.3), R(-0.05714285714285714286), R(0.25714285714285714286)};
  const real w[3] = {R(0.04166666666666666667), R(0.29761904761904761905),
                     R(0.16071428571428571429)};
  const real b[4] = {R(0.04166666666666666667), R(0.37202380952380952381),
                     R(0.48214285714285714286), R(0.10416666666666666667)};
  const realv h2 = h * h;
  stagesv at;
  at.n2[0] = index_force(profile, ray->x, ray->y, ray->z, at.fx, at.fy, at.fz);
  look(&at, 1, ray, profile, h * R(0.2), h2, at.fx[0] * R(0.02), at.fy[0] * R(0.02),
       at.fz[0] * R(0.02));
  look(&at, 2, ray, profile, h * R(0.66666666666666666667), h2, sum_of_2(at.fx, a2[0], a2[1]),
       sum_of_2(at.fy, a2[0], a2[1]), sum_of_2(at.fz, a2[0], a2[1]));
  look(&at, 3, ray, profile, h, h2, sum_of_3(at.fx, a3[0], a3[1], a3[2]),
       sum_of_3(at.fy, a3[0], a3[1], a3[2]), sum_of_3(at.fz, a3[0], a3[1], a3[2]));
  ray->x = mul_add(h, mul_add(h, sum_of_3(at.fx, w[0], w[1], w[2]), ray->tx), ray->x);
  ray->y = mul_add(h, mul_add(h, sum_of_3(at.fy, w[0], w[1], w[2]), ray->ty), ray->y);
  ray->z = mul_add(h, mul_add(h, sum_of_3(at.fz, w[0], w[1], w[2]), ray->tz), ray->z);
  ray->tx = mul_add(h, sum_of_4(at.fx, b[0], b[1], b[2], b[3]), ray->tx);
  ray->ty = mul_add(h, sum_of_4(at.fy, b[0], b[1], b[2], b[3]), ray->ty);
  ray->tz = mul_add(h, sum_of_4(at.fz, b[0], b[1], b[2], b[3]), ray->tz);
  return h * sum_of_4(at.n2, b[0], b[1], b[2], b[3]);
}
#endif

/* short_step - a step so short that the force in its middle is enough. As gradient_step.
 *
 * force out   that force, as the direction of a ray
 * n2 out      n^2 there
 */
INLINE realv short_step(rayv *ray, global const real *profile, realv h, rayv *force, realv *n2) {
  realv half_h = R(0.5) * h;
  *n2 = index_force(profile, mul_add(half_h, ray->tx, ray->x), mul_add(half_h, ray->ty, ray->y),
                      mul_add(half_h, ray->tz, ray->z), &force->tx, &force->ty, &force->tz);
  ray->x = mul_add(h, mul_add(half_h, force->tx, ray->tx), ray->x);
  ray->y = mul_add(h, mul_add(half_h, force->ty, ray->ty), ray->y);
  ray->z = mul_add(h, mul_add(half_h, force->tz, ray->tz), ray->z);
  ray->tx = mul_add(h, force->tx, ray->tx);
  ray->ty = mul_add(h, force->ty, ray->ty);
  ray->tz = mul_add(h, force->tz, ray->tz);
  return h * *n2;
}
#endif

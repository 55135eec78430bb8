/* gradient.cl - rays through lenses whose index changes from place to place.
 *
 * Ray equation in t with ds = n dt:  R'' = grad(n^2) / 2,  T = R' = n times the unit direction: the
 * state of a ray everywhere in the eye.  Source: Sharma, Kumar & Ghatak 1982, Appl Opt 21:984.
 *
 * A profile in the eye's table is GRADIENT_FRAME reals (the vertex of its frame from that of the
 * element; its three axes; 1 for shells) and its numbers: c[i][j] of z^i r^2j, GRADIENT_ROW a row;
 * or core, core - edge, centre, 1 / semi_z^2, 1 / semi_r^2, power - 1.
 */
#include "lib/crossing.cl"
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

/* gauss_step - one step of Gauss's collocation with three stages, two sweeps: order 6.
 *
 * Stages R_i = R + c_i h T + h^2 sum_j a_ij f_j with the square of the method's matrix (Nystroem),
 * begun on the straight line; every sweep gains two orders.
 * Source: Hairer, Norsett & Wanner 1993, Solving ODEs I, II.7 and II.14.
 *
 * ray    in the profile's frame
 * h      step of t, mm
 *
 * Returns the optical path length, mm (HAS_OPL).
 */
INLINE realv gauss_step(rayv *ray, global const real *profile, realv h) {
  const real c[3] = {R(0.11270166537925831148), R(0.5), R(0.88729833462074168852)};
  const real b[3] = {R(0.27777777777777777778), R(0.44444444444444444444),
                     R(0.27777777777777777778)};
  const real a[3][3] = {
      {R(0.0111111111111111111), R(-0.00828851880460926412), R(0.00352824038312730875)},
      {R(0.102402546475103012), R(0.0277777777777777778), R(-0.00518032425288079007)},
      {R(0.218693981839094913), R(0.16384407436016482), R(0.0111111111111111111)}};
  realv fx[3], fy[3], fz[3], n2[3];
  const realv h2 = h * h;
#pragma unroll
  for (int i = 0; i < 3; ++i) {
    realv reach = h * c[i];
    n2[i] = index_force(profile, mul_add(reach, ray->tx, ray->x), mul_add(reach, ray->ty, ray->y),
                          mul_add(reach, ray->tz, ray->z), fx + i, fy + i, fz + i);
  }
  for (int sweep = 0; sweep < 2; ++sweep) {
    realv gx[3], gy[3], gz[3];
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      realv reach = h * c[i];
      realv bx = mul_add(fx[0], (realv)a[i][0], mul_add(fx[1], (realv)a[i][1], fx[2] * a[i][2]));
      realv by = mul_add(fy[0], (realv)a[i][0], mul_add(fy[1], (realv)a[i][1], fy[2] * a[i][2]));
      realv bz = mul_add(fz[0], (realv)a[i][0], mul_add(fz[1], (realv)a[i][1], fz[2] * a[i][2]));
      n2[i] = index_force(profile, mul_add(h2, bx, mul_add(reach, ray->tx, ray->x)),
                            mul_add(h2, by, mul_add(reach, ray->ty, ray->y)),
                            mul_add(h2, bz, mul_add(reach, ray->tz, ray->z)), gx + i, gy + i,
                            gz + i);
    }
#pragma unroll
    for (int i = 0; i < 3; ++i) fx[i] = gx[i], fy[i] = gy[i], fz[i] = gz[i];
  }
  /* b_i (1 - c_i) */
  const real w[3] = {b[0] * c[2], b[1] * R(0.5), b[2] * c[0]};
  realv jx = mul_add(fx[0], (realv)w[0], mul_add(fx[1], (realv)w[1], fx[2] * w[2]));
  realv jy = mul_add(fy[0], (realv)w[0], mul_add(fy[1], (realv)w[1], fy[2] * w[2]));
  realv jz = mul_add(fz[0], (realv)w[0], mul_add(fz[1], (realv)w[1], fz[2] * w[2]));
  ray->x = mul_add(h, mul_add(h, jx, ray->tx), ray->x);
  ray->y = mul_add(h, mul_add(h, jy, ray->ty), ray->y);
  ray->z = mul_add(h, mul_add(h, jz, ray->tz), ray->z);
  ray->tx = mul_add(h, mul_add(fx[0] + fx[2], (realv)b[0], fx[1] * b[1]), ray->tx);
  ray->ty = mul_add(h, mul_add(fy[0] + fy[2], (realv)b[0], fy[1] * b[1]), ray->ty);
  ray->tz = mul_add(h, mul_add(fz[0] + fz[2], (realv)b[0], fz[1] * b[1]), ray->tz);
  return h * mul_add(n2[0] + n2[2], (realv)b[0], n2[1] * b[1]);
}

/* short_step - a step so short that the force in its middle is enough. As gauss_step.
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

/* GRADIENT_NEAR - how far from a surface the last straight step may begin, in units of T, mm.
 * Straight it is wrong by 0.03 of the square of that.
 */
#if DOUBLE_PRECISION
#define GRADIENT_NEAR 1e-4
#else
#define GRADIENT_NEAR 1e-2f
#endif

/* approach_element - as cross_element, for rays that are almost there (round > 0). */
INLINE maskv approach_element(rayv *ray, constant element_t *element,
                              global const real *eye_table, real sense, int far_side, int round,
                              crossingv *at) {
#if !HAS_FORMS
  if (round > 0) {
    conic_approach(ray, element, sense, at);
    return -1;
  }
  if (element->curvature == 0) {
    at->path = -ray->z / ray->tz;
    return -1;
  }
#endif
  return cross_element(ray, element, eye_table, sense, far_side, at);
}

/* cross_gradient - moves rays through the gradient in front of an element onto it.
 *
 * The straight way to the element is the length of t to integrate; what is left of the way is gone
 * the same way with fewer steps, then in a short step, then straight.
 *
 * As cross_element. A ray that does not get there becomes NaN. at->path is the optical path length
 * over the square of the index at the element's vertex (HAS_OPL).
 */
INLINE maskv cross_gradient(rayv *ray, constant element_t *element, global const real *eye_table,
                            real sense, int far_side, crossingv *at) {
  global const real *profile = eye_table + element->gradient_incident;
  maskv met = -1;
  realv length = 0, n2 = 1;
  rayv force = *ray;
  const int rounds = element->gradient_rounds + 2;
  for (int round = 0; round < rounds; ++round) {
    rayv straight = *ray;
    met = met & approach_element(&straight, element, eye_table, sense, far_side, round, at);
    realv way = is_number(at->path) ? at->path : -ray->z / ray->tz;
    to_profile(ray, profile);
    if (round == rounds - 1) {
      length += short_step(ray, profile, way, &force, &n2);
    } else {
      const int steps = round == 0 ? element->gradient_steps : element->gradient_landing;
      const realv h = way * (R(1.0) / (real)steps);
      for (int i = 0; i < steps; ++i) length += gauss_step(ray, profile, h);
    }
    from_profile(ray, profile);
  }
  met = met & approach_element(ray, element, eye_table, sense, far_side, rounds, at);
  from_profile(&force, profile);
  ray->tx = mul_add(at->path, force.tx, ray->tx);
  ray->ty = mul_add(at->path, force.ty, ray->ty);
  ray->tz = mul_add(at->path, force.tz, ray->tz);
  maskv landed = magnitude(at->path) <= GRADIENT_NEAR;
  ray->x = landed ? ray->x : (realv)NAN;
#if HAS_OPL
  at->path = mul_add(at->path, n2, length) * element->inverse_n2;
#endif
  return met;
}

/* squared_index_after - n^2 of the medium behind a surface at points on it. */
INLINE realv squared_index_after(const rayv *ray, constant element_t *element,
                                 global const real *eye_table) {
  if (element->gradient_transmitted < 0) return element->n2_transmitted;
  global const real *profile = eye_table + element->gradient_transmitted;
  rayv there = *ray;
  to_profile(&there, profile);
  realv fx, fy, fz;
  return index_force(profile, there.x, there.y, there.z, &fx, &fy, &fz);
}
#endif

/* arrive - as cross_element, through whatever medium lies in front of the element. */
INLINE maskv arrive(rayv *ray, constant element_t *element, global const real *eye_table,
                    real sense, int far_side, crossingv *at) {
#if HAS_GRADIENTS
  if (element->gradient_incident >= 0)
    return cross_gradient(ray, element, eye_table, sense, far_side, at);
#endif
  return cross_element(ray, element, eye_table, sense, far_side, at);
}

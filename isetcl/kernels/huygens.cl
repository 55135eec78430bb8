/* huygens.cl - the image of a point: the sum of the spherical waves of all samples of a wavefront. */
#include "lib/real.cl"

/* A number whose sum with x, |x| < 2^20, has the nearest integer to x in its last bits. */
#if DOUBLE_PRECISION
#define ROUNDER 6755399441055744.0
#define SIGN_SHIFT 62
#else
#define ROUNDER 12582912.0f
#define SIGN_SHIFT 30
#endif

#if WIDTH == 1 && DOUBLE_PRECISION
#define bits_from_real(x) as_long(x)
#define real_from_bits(x) as_double(x)
#elif WIDTH == 1
#define bits_from_real(x) as_int(x)
#define real_from_bits(x) as_float(x)
#else
#define bits_from_real(x) __builtin_astype((x), maskv)
#define real_from_bits(x) __builtin_astype((x), realv)
#endif

/* sine_cosine_waves - sin and cos of 2 pi u, |u| < 2^20. */
INLINE void sine_cosine_waves(realv u, realv *sine, realv *cosine) {
  realv shifted = mul_add(u, (realv)R(4.0), (realv)ROUNDER);
  maskv quadrant = bits_from_real(shifted);
  realv rest = mul_add(u, (realv)R(4.0), -(shifted - ROUNDER));
  realv s, c;
  sine_cosine_quarter(rest * R(1.57079632679489661923), &s, &c);
  maskv swapped = (quadrant & 1) != 0;
  realv a = swapped ? c : s, b = swapped ? s : c;
  *sine = real_from_bits(bits_from_real(a) ^ ((quadrant & 2) << SIGN_SHIFT));
  *cosine = real_from_bits(bits_from_real(b) ^ (((quadrant + 1) & 2) << SIGN_SHIFT));
}

/* spherical_wave - length and strength of the way from a point of the reference sphere.
 *
 * A sample lies R d before the reference point and the image point p beside it; the way between is
 * |R d + p| = R sqrt(1 + t), t = (2 R d.p + p.p) / R^2 = bend w, w its first order in waves:
 *     (|R d + p| - R) n' / lambda = 2 w / (1 + sqrt(1 + t)) = w (1 - t / 4 + t^2 / 8 - ...)
 *     R / |R d + p| = 1 / sqrt(1 + t) = 1 - t / 2 + 3 t^2 / 8 - ...
 * Nothing cancels in either form. The series with ORDER terms beyond the first is as good as exact
 * where the image is small beside R; the host chooses ORDER, 0 is for the roots.
 *
 * w        first order of the way, waves
 * bend     2 lambda / (n' R)
 * strength out: R / |R d + p|
 *
 * Returns the way less R, waves.
 */
INLINE realv spherical_wave(realv w, real bend, constant real *series, realv *strength) {
  realv t = w * bend;
#if ORDER > 0
  realv excess = (realv)series[ORDER - 1], weaker = (realv)series[2 * ORDER - 1];
#pragma unroll
  for (int k = ORDER - 2; k >= 0; --k) {
    excess = mul_add(excess, t, (realv)series[k]);
    weaker = mul_add(weaker, t, (realv)series[ORDER + k]);
  }
  *strength = mul_add(weaker, t, (realv)R(1.0));
  return mul_add(excess * t, w, w);
#else
  realv root = square_root(1 + t);
  realv sum = 1 + root;
  realv inverse = 1 / (sum * sum * root);
  *strength = sum * sum * inverse;
  return mul_add(-w, t * root * inverse, w);
#endif
}

/* huygens - amplitudes at image points from a part of the samples; lanes are image points.
 *
 * samples     records of four: pupil coordinates x, y in cycles/degree, phase in waves (-1/2 to
 *             1/2), amplitude
 * n_samples, n_part   their number, and that of one part: the second index of the launch
 * points      planes of n_points: visual angles x, y in degrees, p.p n' / (2 R lambda) in waves
 * series      coefficients by ascending powers of t, from the first: of the way, of the strength
 * amplitude   out: for each part planes of the real and imaginary parts
 */
kernel void huygens(global const real4 *restrict samples, const int n_samples, const int n_part,
                    global const real *restrict points, const int n_points, const real bend,
                    constant real *series, global real *restrict amplitude) {
  const size_t group = get_global_id(0), part = get_global_id(1);
  realv x = load_lanes(points, group), y = load_lanes(points + n_points, group);
  realv own = load_lanes(points + 2 * (size_t)n_points, group);
  realv re = 0, im = 0;
  const int first = (int)part * n_part;
  const int end = first + n_part < n_samples ? first + n_part : n_samples;
  for (int i = first; i < end; ++i) {
    real4 sample = samples[i];
    realv w = mul_add((realv)sample.x, x, mul_add((realv)sample.y, y, own));
    realv strength, s, c;
    realv phase = spherical_wave(w, bend, series, &strength) + sample.z;
    sine_cosine_waves(phase, &s, &c);
    strength *= sample.w;
    re = mul_add(strength, c, re);
    im = mul_add(strength, s, im);
  }
  global real *out = amplitude + 2 * part * n_points;
  store_lanes(re, out, group);
  store_lanes(im, out + n_points, group);
}

/* logarithm.cl - the natural logarithm in lanes. */
#include "lib/real.cl"

#if WIDTH == 1
#if DOUBLE_PRECISION
#define bits_of_real(x) as_long(x)
#define real_of_bits(x) as_double(x)
#else
#define bits_of_real(x) as_int(x)
#define real_of_bits(x) as_float(x)
#endif
#define real_from_bits(x) ((realv)(x))
#else
#define bits_of_real(x) __builtin_astype((x), maskv)
#define real_of_bits(x) __builtin_astype((x), realv)
#define real_from_bits(x) __builtin_convertvector((x), realv)
#endif

#if DOUBLE_PRECISION
#define MANTISSA_BITS 52
#define ROOT_HALF_BITS 0x3fe6a09e667f3bcdL
#define MANTISSA_MASK 0x000fffffffffffffL
#else
#define MANTISSA_BITS 23
#define ROOT_HALF_BITS 0x3f3504f3
#define MANTISSA_MASK 0x007fffff
#endif

/* natural_log - ln x for normal x > 0, to 1.5 units in the last place.
 *
 * x = 2^k (1 + f) with 1 + f between sqrt(1/2) and sqrt(2); with s = f / (2 + f),
 * ln(1 + f) = f - f^2/2 + s (f^2/2 + R(s^2)).
 * Source: FreeBSD msun, e_log.c and e_logf.c (Sun Microsystems 1993): the polynomials R.
 */
INLINE realv natural_log(realv x) {
  maskv bits = bits_of_real(x) - ROOT_HALF_BITS;
  realv k = real_from_bits(bits >> MANTISSA_BITS);
  realv f = real_of_bits((bits & MANTISSA_MASK) + ROOT_HALF_BITS) - 1;
  realv s = f / (2 + f);
  realv z = s * s;
#if DOUBLE_PRECISION
  realv r = 1.479819860511658591e-01;
  r = mul_add(r, z, (realv)1.531383769920937332e-01);
  r = mul_add(r, z, (realv)1.818357216161805012e-01);
  r = mul_add(r, z, (realv)2.222219843214978396e-01);
  r = mul_add(r, z, (realv)2.857142874366239149e-01);
  r = mul_add(r, z, (realv)3.999999999940941908e-01);
  r = mul_add(r, z, (realv)6.666666666666735130e-01);
  const real high = 6.93147180369123816490e-01, low = 1.90821492927058770002e-10;
#else
  realv r = 0.24279078841f;
  r = mul_add(r, z, (realv)0.28498786688f);
  r = mul_add(r, z, (realv)0.40000972152f);
  r = mul_add(r, z, (realv)0.66666662693f);
  const real high = 6.9313812256e-01f, low = 9.0580006145e-06f;
#endif
  realv half_square = R(0.5) * f * f;
  realv rest = mul_add(s, mul_add(r, z, half_square), k * low);
  return mul_add(k, (realv)high, f - (half_square - rest));
}

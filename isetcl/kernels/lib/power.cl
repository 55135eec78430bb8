/* power.cl - real powers, lane by lane, without library functions. */
#include "lib/real.cl"

#if WIDTH > 1
#define bits_of(x) __builtin_astype((x), maskv)
#define real_of_bits(x) __builtin_astype((x), realv)
#define real_from_bits(x) __builtin_convertvector((x), realv)
#elif DOUBLE_PRECISION
#define bits_of(x) as_long(x)
#define real_of_bits(x) as_double(x)
#define real_from_bits(x) ((realv)(x))
#else
#define bits_of(x) as_int(x)
#define real_of_bits(x) as_float(x)
#define real_from_bits(x) ((realv)(x))
#endif

#if DOUBLE_PRECISION
#define MANTISSA_BITS 52
#define ROOT_HALF_BITS 0x3fe6a09e667f3bcdL /* sqrt(1/2) */
#define EXPONENT_BIAS 1023L
#define MOST_EXPONENT 1000.0
#else
#define MANTISSA_BITS 23
#define ROOT_HALF_BITS 0x3f3504f3
#define EXPONENT_BIAS 127
#define MOST_EXPONENT 120.0f
#endif

/* log2_lanes - the logarithm to base 2 of normal numbers x > 0.
 *
 * x = m 2^e with sqrt(1/2) <= m < sqrt(2).  log m from z = m - 1: float 1e-7, double 2e-16 of it.
 * Source: S. Moshier, Cephes logf and log.
 */
INLINE realv log2_lanes(realv x) {
  maskv bits = bits_of(x) - ROOT_HALF_BITS;
  maskv exponent = bits >> MANTISSA_BITS;
  realv z = real_of_bits(bits - (exponent << MANTISSA_BITS) + ROOT_HALF_BITS) - 1;
  realv z2 = z * z;
#if DOUBLE_PRECISION
  realv p = 1.01875663804580931796e-4;
  p = mul_add(p, z, (realv)4.97494994976747001425e-1);
  p = mul_add(p, z, (realv)4.70579119878881725854);
  p = mul_add(p, z, (realv)1.44989225341610930846e1);
  p = mul_add(p, z, (realv)1.79368678507819816313e1);
  p = mul_add(p, z, (realv)7.70838733755885391666);
  realv q = z + 1.12873587189167450590e1;
  q = mul_add(q, z, (realv)4.52279145837532221105e1);
  q = mul_add(q, z, (realv)8.29875266912776603211e1);
  q = mul_add(q, z, (realv)7.11544750618563894466e1);
  q = mul_add(q, z, (realv)2.31251620126765340583e1);
  p /= q;
#else
  realv p = 7.0376836292e-2f;
  p = mul_add(p, z, (realv)-1.1514610310e-1f);
  p = mul_add(p, z, (realv)1.1676998740e-1f);
  p = mul_add(p, z, (realv)-1.2420140846e-1f);
  p = mul_add(p, z, (realv)1.4249322787e-1f);
  p = mul_add(p, z, (realv)-1.6668057665e-1f);
  p = mul_add(p, z, (realv)2.0000714765e-1f);
  p = mul_add(p, z, (realv)-2.4999993993e-1f);
  p = mul_add(p, z, (realv)3.3333331174e-1f);
#endif
  /* log2 m = log2(e) (z + z^2 (z p - 1/2)), the leading term with a constant of two parts. */
  realv rest = z2 * mul_add(z, p, (realv)R(-0.5));
  const realv over_one = (realv)R(0.44269504088896340736); /* log2(e) - 1 */
  realv log_m = mul_add(z, over_one, mul_add(rest, over_one, rest)) + z;
  return real_from_bits(exponent) + log_m;
}

/* exp2_lanes - 2^x; x is cut to where the result is a normal number.
 *
 * Float 1e-7, double 2e-16.  Source: S. Moshier, Cephes exp2f and exp2.
 */
INLINE realv exp2_lanes(realv x) {
  x = smaller(larger(x, (realv)-MOST_EXPONENT), (realv)MOST_EXPONENT);
  intv nearest = whole(x + R(0.5));
  realv f = x - real_from_int(nearest);
#if DOUBLE_PRECISION
  realv f2 = f * f;
  realv p = mul_add((realv)2.30933477057345225087e-2, f2, (realv)2.02020656693165307700e1);
  p = f * mul_add(p, f2, (realv)1.51390680115615096133e3);
  realv q = mul_add(f2 + 2.33184211722314911771e2, f2, (realv)4.36821166879210612817e3);
  realv fraction = mul_add((realv)2, p / (q - p), (realv)1);
#else
  realv p = 1.535336188319500e-4f;
  p = mul_add(p, f, (realv)1.339887440266574e-3f);
  p = mul_add(p, f, (realv)9.618437357674640e-3f);
  p = mul_add(p, f, (realv)5.550332471162809e-2f);
  p = mul_add(p, f, (realv)2.402264791363012e-1f);
  p = mul_add(p, f, (realv)6.931472028550421e-1f);
  realv fraction = mul_add(p, f, (realv)1);
#endif
#if WIDTH > 1
  maskv scale = (mask_from_int(nearest) + EXPONENT_BIAS) << MANTISSA_BITS;
#else
  maskv scale = ((maskv)nearest + EXPONENT_BIAS) << MANTISSA_BITS;
#endif
  return fraction * real_of_bits(scale);
}

/* power_lanes - x^p for x >= 0. */
INLINE realv power_lanes(realv x, real p) {
  return exp2_lanes(p * log2_lanes(larger(x, (realv)R(1e-30))));
}

/* whole_power - x^p for a whole p >= 0 that is the same in all lanes. */
INLINE realv whole_power(realv x, int p) {
  realv result = 1;
  for (; p > 0; p >>= 1) {
    if (p & 1) result *= x;
    x *= x;
  }
  return result;
}

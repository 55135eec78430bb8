/* sobol.cl - Owen-scrambled Sobol' points, without tables per pixel and without state.
 *
 * A coordinate is a function of (seed, pixel, replicate, sample, dimension) alone, so an image does
 * not depend on how it was cut into tiles or launches. The sample number is the same in all lanes;
 * its Sobol' digits are scalars, and only the scrambling, different in every pixel, is done in lanes.
 */
#include "lib/real.cl"

/* mix_bits - a bijection of 32-bit words with low bias.
 *
 * Source: C. Wellons, lowbias32 (hash-prospector).
 */
INLINE uintv mix_bits(uintv x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

INLINE uintv reverse_bits(uintv x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

/* sobol_digits - binary digits of coordinate `dimension` of point `index`, first digit lowest.
 *
 * SOBOL_DIRECTIONS: bit-reversed direction numbers of Joe & Kuo 2008, from the host.
 */
INLINE uint sobol_digits(uint index, int dimension) {
  uint digits = 0;
  for (int bit = 0; index != 0; ++bit, index >>= 1)
    digits ^= SOBOL_DIRECTIONS[32 * dimension + bit] & (0u - (index & 1u));
  return digits;
}

/* owen_scramble - a random permutation of the digit tree, chosen by `seed` in every lane.
 *
 * Every digit is flipped by a hash of the digits before it.
 * digits   digits of a coordinate, first digit lowest
 * Source: Laine & Karras 2011, EGSR; constants of N. Vegdahl (2021).
 */
INLINE uintv owen_scramble(uintv digits, uintv seed) {
  digits ^= digits * 0x3d20adeau;
  digits += seed;
  digits *= (seed >> 16) | 1u;
  digits ^= digits * 0x05526c56u;
  digits ^= digits * 0x53a22864u;
  return digits;
}

/* unit_real - a real in [0, 1) from digits, first digit lowest: 24 bits in float, 31 in double. */
INLINE realv unit_real(uintv digits) {
  uintv word = reverse_bits(digits);
#if DOUBLE_PRECISION
  return real_from_int(int_from_uint(word >> 1)) * 0x1p-31;
#else
  return real_from_int(int_from_uint(word >> 8)) * 0x1p-24f;
#endif
}

/* random_coordinate - number `index` of an independent random sequence, in [0, 1).
 *
 * Two rounds of a hash with two words of `seed`: sequences of other seeds are not shifts of this one.
 */
INLINE realv random_coordinate(uintv index, uintv seed) {
  return unit_real(mix_bits(mix_bits(index + seed) + mix_bits(seed ^ 0x68bc21ebu)));
}

/* sobol_coordinate - coordinate `dimension` of sample `index`, in [0, 1).
 *
 * RANDOM_SAMPLES: independent random numbers instead, for references that share no point set.
 * stream   a word for each lane, from (seed, replicate, pixel)
 */
INLINE realv sobol_coordinate(uint index, int dimension, uintv stream) {
  uintv seed = mix_bits(stream + (uint)dimension * 0x632be5abu);
#if RANDOM_SAMPLES
  return random_coordinate((uintv)(index), seed);
#else
  return unit_real(owen_scramble((uintv)(sobol_digits(index, dimension)), seed));
#endif
}

/* bounce.cl - the numbers that decide one bounce of a path, for kernels of one path a work-item.
 */
#include "lib/sobol.cl"

INLINE uint4 mix_bits4(uint4 x) {
  x ^= x >> 16;
  x *= 0x7feb352du;
  x ^= x >> 15;
  x *= 0x846ca68bu;
  return x ^ (x >> 16);
}

INLINE uint4 reverse_bits4(uint4 x) {
  x = ((x >> 1) & 0x55555555u) | ((x & 0x55555555u) << 1);
  x = ((x >> 2) & 0x33333333u) | ((x & 0x33333333u) << 2);
  x = ((x >> 4) & 0x0f0f0f0fu) | ((x & 0x0f0f0f0fu) << 4);
  x = ((x >> 8) & 0x00ff00ffu) | ((x & 0x00ff00ffu) << 8);
  return (x >> 16) | (x << 16);
}

/* sobol_point - the four coordinates of a sample in a stream at once; see sobol_coordinate. */
INLINE void sobol_point(uint index, uint stream, real *coordinate) {
  uint4 digits = (uint4)(0);
  for (int bit = 0; index != 0; ++bit, index >>= 1)
    digits ^= SOBOL_DIRECTIONS_BY_BIT[bit] & (uint4)(0u - (index & 1u));
  const uint4 seed =
      mix_bits4((uint4)(stream, stream + 0x632be5abu, stream + 0xc657cb56u, stream + 0x2983b101u));
  digits ^= digits * 0x3d20adeau;
  digits += seed;
  digits *= (seed >> 16) | 1u;
  digits ^= digits * 0x05526c56u;
  digits ^= digits * 0x53a22864u;
  const uint4 word = reverse_bits4(digits);
#if DOUBLE_PRECISION
  coordinate[0] = (real)(word.x >> 1) * 0x1p-31;
  coordinate[1] = (real)(word.y >> 1) * 0x1p-31;
  coordinate[2] = (real)(word.z >> 1) * 0x1p-31;
  coordinate[3] = (real)(word.w >> 1) * 0x1p-31;
#else
  coordinate[0] = (real)(int)(word.x >> 8) * 0x1p-24f;
  coordinate[1] = (real)(int)(word.y >> 8) * 0x1p-24f;
  coordinate[2] = (real)(int)(word.z >> 8) * 0x1p-24f;
  coordinate[3] = (real)(int)(word.w >> 8) * 0x1p-24f;
#endif
}

/* bounce_numbers - eight numbers in [0, 1) for one bounce of a path.
 *
 * Two sets of four Sobol' dimensions; for each bounce and set the samples of a pixel are taken in
 * another order and scrambled anew.
 *
 * bits   digits of the largest sample number
 * Source: B. Burley (2020), "Practical hash-based Owen scrambling", JCGT 9(4), section 4.
 */
INLINE void bounce_numbers(uint sample, int bits, uint pixel_stream, int bounce, real *number) {
  for (int set = 0; set < 2; ++set) {
    const uint stream = mix_bits(pixel_stream ^ mix_bits((uint)(2 * bounce + set + 1) * 0x9e3779b9u));
    const uint order = reverse_bits(owen_scramble(reverse_bits(sample), stream));
    sobol_point(order & ((1u << bits) - 1u), stream, number + 4 * set);
  }
}

/* bounce.cl - the numbers that decide one bounce of a path.
 */
#include "lib/sobol.cl"

/* sobol_point - four coordinates of a sample in a stream at once; see sobol_coordinate.
 *
 * bits   digits of the largest sample number
 */
INLINE void sobol_point(uintv index, int bits, uintv stream, realv *coordinate) {
#if RANDOM_SAMPLES
  coordinate[0] = random_coordinate(index, mix_bits(stream));
  coordinate[1] = random_coordinate(index, mix_bits(stream + 0x632be5abu));
  coordinate[2] = random_coordinate(index, mix_bits(stream + 0xc657cb56u));
  coordinate[3] = random_coordinate(index, mix_bits(stream + 0x2983b101u));
#else
  uintv x = 0, y = 0, z = 0, w = 0;
  for (int bit = 0; bit < bits; ++bit) {
    const uint4 direction = SOBOL_DIRECTIONS_BY_BIT[bit];
    const uintv chosen = (uintv)(0u) - ((index >> (uint)bit) & 1u);
    x ^= chosen & direction.x;
    y ^= chosen & direction.y;
    z ^= chosen & direction.z;
    w ^= chosen & direction.w;
  }
  coordinate[0] = unit_real(owen_scramble(x, mix_bits(stream)));
  coordinate[1] = unit_real(owen_scramble(y, mix_bits(stream + 0x632be5abu)));
  coordinate[2] = unit_real(owen_scramble(z, mix_bits(stream + 0xc657cb56u)));
  coordinate[3] = unit_real(owen_scramble(w, mix_bits(stream + 0x2983b101u)));
#endif
}

/* bounce_numbers - four numbers in [0, 1) for one bounce of a path.
 *
 * Sets of four Sobol' dimensions; for each bounce and set the samples of a pixel are taken in
 * another order and scrambled anew.
 *
 * bits   digits of the largest sample number
 * set    0 or 1
 * Source: B. Burley (2020), "Practical hash-based Owen scrambling", JCGT 9(4), section 4.
 */
INLINE void bounce_numbers(uintv sample, int bits, uintv pixel_stream, int bounce, int set,
                           realv *number) {
  const uintv salt = (uintv)((uint)(2 * bounce + set + 1) * 0x9e3779b9u);
  const uintv stream = mix_bits(pixel_stream ^ mix_bits(salt));
  const uintv order = reverse_bits(owen_scramble(reverse_bits(sample), stream));
  sobol_point(order & ((1u << bits) - 1u), bits, stream, number);
}

/* plane.cl - smooth functions of two field angles, fitted on the host. */
#include "lib/real.cl"

#define PLANE_FUNCTIONS 6

/* plane_polynomials - six polynomials sum c_ij u^i v^j, i + j <= degree, by nested Horner's rules.
 *
 * c      coefficients, those of six functions side by side: i from the degree down to 0 and, for
 *        each, j from degree - i down to 0
 * u, v   from -1 to 1
 */
INLINE void plane_polynomials(global const real *c, int degree, realv u, realv v, realv *sum) {
  for (int f = 0; f < PLANE_FUNCTIONS; ++f) sum[f] = (realv)0;
  for (int i = degree; i >= 0; --i) {
    realv inner[PLANE_FUNCTIONS];
    for (int f = 0; f < PLANE_FUNCTIONS; ++f) inner[f] = (realv)0;
    for (int j = degree - i; j >= 0; --j) {
#pragma unroll
      for (int f = 0; f < PLANE_FUNCTIONS; ++f) inner[f] = mul_add(inner[f], v, (realv)c[f]);
      c += PLANE_FUNCTIONS;
    }
#pragma unroll
    for (int f = 0; f < PLANE_FUNCTIONS; ++f) sum[f] = mul_add(sum[f], u, inner[f]);
  }
}

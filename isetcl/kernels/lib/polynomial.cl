/* polynomial.cl - smooth functions of field angle, fitted on the host. */
#include "lib/real.cl"

/* horner - c[0] + c[1] s + ... + c[terms - 1] s^(terms - 1). */
INLINE realv horner(constant real *c, int terms, realv s) {
  realv sum = c[terms - 1];
  for (int i = terms - 2; i >= 0; --i) sum = mul_add(sum, s, (realv)c[i]);
  return sum;
}

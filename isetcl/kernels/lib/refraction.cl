/* refraction.cl - Snell's law. */
#include "lib/conic.cl"

/* refract - bends rays at a surface by Snell's law; a totally reflected ray becomes NaN.
 *
 * T' = T + Gamma g,  Gamma = sense (n'^2 - n^2) / (sqrt(q^2 + (n'^2 - n^2) |g|^2) + |q|),
 * followed by one Newton step towards |T'| = n'.
 *
 * ray   rays on the surface
 * s     surface constants for this direction of travel
 * at    where they cross it. Where all surfaces are conics about the axis of the eye, g is set here:
 *       carrying it from the crossing through the choice between surfaces and the stop takes up to a
 *       third of the time of a whole trace
 */
INLINE void refract(rayv *ray, constant element_t *s, real sense, crossingv *at) {
#if !HAS_FORMS
  conic_slope(ray, s, at);
#endif
  realv root = square_root(mul_add((realv)s->index_step, at->g2, at->q * at->q));
  realv bend = sense * s->index_step / (mul_add((realv)sense, at->q, root) + (realv)R(1e-30));
  realv tx = mul_add(bend, at->gx, ray->tx);
  realv ty = mul_add(bend, at->gy, ray->ty);
  realv tz = mul_add(bend, at->gz, ray->tz);
  realv excess = mul_add(tx, tx, mul_add(ty, ty, mul_add(tz, tz, (realv)-s->n2_transmitted)));
  realv correct = mul_add((realv)s->renormalise, excess, (realv)1);
  ray->tx = tx * correct;
  ray->ty = ty * correct;
  ray->tz = tz * correct;
}

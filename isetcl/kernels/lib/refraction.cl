/* refraction.cl - Snell's law. */
#include "lib/gradient.cl"

/* refract - bends rays at a surface by Snell's law; a totally reflected ray becomes NaN.
 *
 * T' = T + Gamma g,  Gamma = sense (n'^2 - n^2) / (sqrt(q^2 + (n'^2 - n^2) |g|^2) + |q|),
 * followed by one Newton step towards |T'| = n'.
 *
 * Where a gradient begins or ends n and n' are those at the point: |T| and what its profile gives.
 *
 * ray         rays on the surface
 * s           surface constants for this direction of travel
 * eye_table   where the profiles of gradients are
 * at    where they cross it. Where all surfaces are conics about the axis of the eye, g is set here:
 *       carrying it from the crossing through the choice between surfaces and the stop takes up to a
 *       third of the time of a whole trace
 */
INLINE void refract(rayv *ray, constant element_t *s, global const real *eye_table, real sense,
                    crossingv *at) {
#if !HAS_FORMS
  conic_slope(ray, s, at);
#endif
#if HAS_GRADIENTS
  realv n2_transmitted = s->n2_transmitted, index_step = s->index_step;
  if (s->gradient_incident >= 0)
    at->q = mul_add(at->gx, ray->tx, mul_add(at->gy, ray->ty, at->gz * ray->tz));
  if (s->gradient_incident >= 0 || s->gradient_transmitted >= 0) {
    n2_transmitted = squared_index_after(ray, s, eye_table);
    index_step = n2_transmitted - squared_length(ray);
  }
#else
  const real n2_transmitted = s->n2_transmitted, index_step = s->index_step;
#endif
  realv root = square_root(mul_add((realv)index_step, at->g2, at->q * at->q));
  realv bend = sense * index_step / (mul_add((realv)sense, at->q, root) + (realv)R(1e-30));
  realv tx = mul_add(bend, at->gx, ray->tx);
  realv ty = mul_add(bend, at->gy, ray->ty);
  realv tz = mul_add(bend, at->gz, ray->tz);
  realv excess = mul_add(tx, tx, mul_add(ty, ty, mul_add(tz, tz, (realv)-n2_transmitted)));
  realv correct = mul_add((realv)s->renormalise, excess, (realv)1);
  ray->tx = tx * correct;
  ray->ty = ty * correct;
  ray->tz = tz * correct;
}

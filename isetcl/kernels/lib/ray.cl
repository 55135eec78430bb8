/* ray.cl - rays inside an eye, and where they cross its elements.
 *
 * A direction T is scaled to the index of the medium, |T| = n. Then neither the length of the
 * surface gradient nor a division by the index is needed at a refraction.
 */
#include "lib/real.cl"

/* rayv - WIDTH rays: a point (mm) and a direction of length n. */
typedef struct {
  realv x, y, z;
  realv tx, ty, tz;
} rayv;

/* squared_length - |T|^2. */
INLINE realv squared_length(const rayv *ray) {
  return mul_add(ray->tx, ray->tx, mul_add(ray->ty, ray->ty, ray->tz * ray->tz));
}

/* crossingv - where WIDTH rays cross an element.
 *
 * path       from the old point to the new one, in units of T
 * q          g . T, the sine-free part of Snell's law
 * gx, gy, gz, g2   slope g of the surface (towards +z) in the eye frame, and its square
 * ax, ay     the point in the element's own frame, as its aperture measures it, mm
 *
 * q is set at surfaces only, not at the stop; g where a ray is refracted (lib/refraction.cl).
 */
typedef struct {
  realv path, q;
  realv gx, gy, gz, g2;
  realv ax, ay;
} crossingv;

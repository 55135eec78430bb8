/* pixel.cl - where on the retina the samples of a pixel lie.
 *
 * A pixel is a rectangle of field angles on a grid. With HAS_PLACES it is the aperture of a
 * receptor: an ellipse of field angles, which on the retina is a disc or, with HAS_GAUSSIAN_PLACES,
 * a Gaussian.
 */
#include "lib/disc.cl"
#include "lib/lanes.cl"
#if HAS_GAUSSIAN_PLACES
#include "lib/logarithm.cl"
#endif

/* One pixel a lane: column and row or, of a place, its middle and the matrix that makes the ellipse
 * of the unit disc. */
typedef struct {
  realv x, y;
#if HAS_PLACES
  realv xx, xy, yx, yy;
#endif
} pixelv;

#if HAS_GAUSSIAN_PLACES
/* gaussian_stretch - the factor that makes points of the unit disc those of a Gaussian.
 *
 * A share q of the light of exp(-r^2), cut off at 2.6, lies within r: r^2 = -ln(1 - c q), with
 * c = 1 - exp(-2.6^2). Points of the disc have q = rho^2.
 */
INLINE realv gaussian_stretch(realv rho2) {
  realv r2 = -natural_log(mul_add(rho2, (realv)R(-0.99884077), (realv)1));
  realv least = rho2 > R(1e-12) ? rho2 : (realv)1;
  return rho2 > R(1e-12) ? square_root(r2 / least) : (realv)1;
}
#endif

/* pixel_at - the pixels of a group; not as a result, since Oclgrind returns no structures. */
INLINE void pixel_at(constant camera_t *camera, global const real *eye_table, uintv row,
                     uintv column, pixelv *pixel) {
#if HAS_PLACES
  uintv number = row * (uint)camera->image_width + column;
  for (int i = 0; i < WIDTH; ++i) {
    global const real *place = eye_table + camera->places + 6 * (size_t)LANE(number, i);
    LANE(pixel->x, i) = place[0];
    LANE(pixel->y, i) = place[1];
    LANE(pixel->xx, i) = place[2];
    LANE(pixel->xy, i) = place[3];
    LANE(pixel->yx, i) = place[4];
    LANE(pixel->yy, i) = place[5];
  }
#else
  pixel->x = real_from_int(int_from_uint(column));
  pixel->y = real_from_int(int_from_uint(row));
#endif
}

/* point_in_pixel - the field angles of a sample; u, v in the unit square. */
INLINE void point_in_pixel(constant camera_t *camera, const pixelv *pixel, realv u, realv v,
                           realv *gx, realv *gy) {
#if HAS_PLACES
  realv px, py;
  concentric_disc(u, v, &px, &py);
#if HAS_GAUSSIAN_PLACES
  realv stretch = gaussian_stretch(mul_add(px, px, py * py));
  px *= stretch;
  py *= stretch;
#endif
  *gx = mul_add(pixel->xx, px, mul_add(pixel->xy, py, pixel->x));
  *gy = mul_add(pixel->yx, px, mul_add(pixel->yy, py, pixel->y));
#else
  *gx = mul_add(pixel->x + u, (realv)camera->step_x, (realv)camera->left);
  *gy = mul_add(pixel->y + v, (realv)camera->step_y, (realv)camera->top);
#endif
}

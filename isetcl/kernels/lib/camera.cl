/* camera.cl - from a sample in a retinal pixel to a ray that aims at the stop.
 *
 * Positions on the retina are polynomials of the squared field angle; so is the ellipse in the
 * plane of the exit pupil that the stop fills. Field angles are in units of the largest one.
 *
 * In an eye that is no figure of revolution they are polynomials of both field angles, which count
 * from -1 to 1 over the image.
 */
#include "lib/disc.cl"
#include "lib/height_map.cl"
#include "lib/placement.cl"
#include "lib/plane.cl"
#include "lib/polynomial.cl"
#include "lib/refraction.cl"

/* aimed - directs a ray and weighs it: (n'/n)^2 A cos(retina) cos(pupil) / d^2, the irradiance per
 * unit radiance times the inverse of the density 1/A.  Source: Born & Wolf, 4.8;
 * the index factor is conservation of basic radiance.
 *
 * ray          direction out, of length n
 * dx, dy, dz   to the point of the exit pupil
 * area         A / pi
 * cosine       |cos| at the retina times the length of d
 */
INLINE realv aimed(constant pupil_t *pupil, realv dx, realv dy, realv dz, realv area,
                   realv cosine, rayv *ray) {
  realv inverse = 1 / square_root(mul_add(dx, dx, mul_add(dy, dy, dz * dz)));
  realv inverse2 = inverse * inverse;
  realv cosines = cosine * -dz;
  realv scale = inverse * pupil->index;
  ray->tx = dx * scale;
  ray->ty = dy * scale;
  ray->tz = dz * scale;
  return pupil->pi_index_ratio2 * area * cosines * (inverse2 * inverse2);
}

#if HAS_ASYMMETRY
#if HAS_RELIEF
/* add_relief - moves a point of a smooth retina and its unit normal onto the heights that lie on it.
 *
 * at   point, mm, and normal, eye frame
 */
INLINE void add_relief(constant element_t *retina, global const real *eye_table, realv *at) {
  realv x = at[0] - retina->decentre_x, y = at[1] - retina->decentre_y;
  realv z = at[2] - retina->vertex_z;
  enter_frame(retina, &x, &y, &z);
  departurev departure;
  height_map_departure(x, y, retina, eye_table + retina->table, &departure);
  realv lift_x = (realv)0, lift_y = (realv)0, lift_z = departure.height;
  leave_frame(retina, &lift_x, &lift_y, &lift_z);
  at[0] += lift_x;
  at[1] += lift_y;
  at[2] += lift_z;
  realv nx = at[3], ny = at[4], nz = at[5];
  enter_frame(retina, &nx, &ny, &nz);
  nx = mul_add(-nz, departure.slope_x, nx);
  ny = mul_add(-nz, departure.slope_y, ny);
  const realv inverse = 1 / square_root(mul_add(nx, nx, mul_add(ny, ny, nz * nz)));
  leave_frame(retina, &nx, &ny, &nz);
  at[3] = nx * inverse;
  at[4] = ny * inverse;
  at[5] = nz * inverse;
}
#endif

/* aim_from_retina - a ray from a point of the retina to a point of the exit pupil drawn uniformly
 * in its ellipse.
 *
 * elements    of all bands; behind them the retina, if it has a relief
 * gx, gy      field angles
 * u, v        point in the unit square
 * eye_table   coefficients of the retina and of every band's ellipse
 *
 * Returns the weight of the sample.
 */
INLINE realv aim_from_retina(constant camera_t *camera, constant pupil_t *pupil,
                             constant element_t *elements, global const real *eye_table, realv gx,
                             realv gy, realv u, realv v, rayv *ray) {
  realv retina[PLANE_FUNCTIONS], ellipse[PLANE_FUNCTIONS], px, py;
  plane_polynomials(eye_table + camera->plane, camera->degree, gx, gy, retina);
  plane_polynomials(eye_table + pupil->plane, pupil->degree, gx, gy, ellipse);
  concentric_disc(u, v, &px, &py);
#if HAS_RELIEF
  add_relief(elements + camera->retina, eye_table, retina);
#endif
  ray->x = retina[0];
  ray->y = retina[1];
  ray->z = retina[2];
  realv dx = mul_add(ellipse[2], px, mul_add(ellipse[3], py, ellipse[0] - ray->x));
  realv dy = mul_add(ellipse[4], px, mul_add(ellipse[5], py, ellipse[1] - ray->y));
  realv dz = pupil->z - ray->z;
  realv area = mul_add(ellipse[2], ellipse[5], -ellipse[3] * ellipse[4]);
  realv cosine = -mul_add(retina[3], dx, mul_add(retina[4], dy, retina[5] * dz));
  return aimed(pupil, dx, dy, dz, area > 0 ? area : -area, cosine, ray);
}
#else

/* retinal_point - the point of the retina that a field vector g belongs to; the image is inverted.
 *
 * ray out   its origin, mm, eye frame
 * s         g . g
 */
INLINE void retinal_point(constant camera_t *camera, realv gx, realv gy, realv s, rayv *ray) {
  realv chord = horner(camera->chord, camera->n_chord, s);
  ray->x = -gx * chord;
  ray->y = -gy * chord;
  ray->z = camera->retina_z + horner(camera->depth, camera->n_depth, s);
}

/* retinal_cosine - |cos| between a direction of length `n` and the retina's normal, times n. */
INLINE realv retinal_cosine(constant camera_t *camera, const rayv *ray, realv dx, realv dy,
                            realv dz) {
  realv gx = -camera->curvature * ray->x;
  realv gy = -camera->curvature * ray->y;
  realv gz = mul_add((realv)(-camera->curvature * camera->kappa), ray->z - camera->retina_z,
                     (realv)1);
  realv along = -mul_add(gx, dx, mul_add(gy, dy, gz * dz));
#if HAS_ASPHERIC_RETINA
  along = along / square_root(mul_add(gx, gx, mul_add(gy, gy, gz * gz)));
#endif
  return along;
}

/* aim_at_pupil - directs a ray at a point of the exit pupil drawn uniformly in its ellipse.
 *
 * ray      origin on the retina; direction out, of length n
 * u, v     point in the unit square
 *
 * Returns the weight of the sample.
 */
INLINE realv aim_at_pupil(constant camera_t *camera, constant pupil_t *pupil, realv gx, realv gy,
                          realv s, realv u, realv v, rayv *ray) {
  realv px, py;
  concentric_disc(u, v, &px, &py);
  realv semi = horner(pupil->semi, pupil->n_semi, s);
  realv stretch = horner(pupil->stretch, pupil->n_stretch, s);
  realv centre = horner(pupil->centre, pupil->n_centre, s);
  realv along = mul_add(stretch, mul_add(gx, px, gy * py), centre);
  realv dx = mul_add(semi, px, mul_add(along, gx, -ray->x));
  realv dy = mul_add(semi, py, mul_add(along, gy, -ray->y));
  realv dz = pupil->z - ray->z;
  realv area = semi * mul_add(stretch, s, semi);
  return aimed(pupil, dx, dy, dz, area, retinal_cosine(camera, ray, dx, dy, dz), ray);
}

/* aim_from_retina - as above, of an eye that is a figure of revolution, of which the camera knows
 * all. */
INLINE realv aim_from_retina(constant camera_t *camera, constant pupil_t *pupil,
                             constant element_t *elements, global const real *eye_table, realv gx,
                             realv gy, realv u, realv v, rayv *ray) {
  realv s = mul_add(gx, gx, gy * gy);
  retinal_point(camera, gx, gy, s, ray);
  return aim_at_pupil(camera, pupil, gx, gy, s, u, v, ray);
}
#endif

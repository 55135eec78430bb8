/* survey.cl - what single rays meet: where, which object, its normal and its reflectance.
 */
#include "lib/find.cl"
#include "lib/scatter.cl"

/* albedo4 - reflectance of a material: of metals along the normal, of clear bodies none. */
INLINE void albedo4(const looks_t *looks, intv substance, const pointv *point, const bandv *band,
                    colourv *albedo) {
  for (int k = 0; k < 4; ++k) albedo->w[k] = (realv)0;
  intv left = substance;
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    global const substance_t *of = looks->substances + number;
    colourv one;
    for (int k = 0; k < 4; ++k) one.w[k] = (realv)0;
#if HAS_DIELECTRICS
    if (of->kind != SUBSTANCE_DIELECTRIC)
#endif
      textured4(looks->textures, of->texture, looks->texels, looks->spectra, looks->n_columns,
                of->row, band, &point->at, &one);
#if HAS_CONDUCTORS
    if (of->kind == SUBSTANCE_CONDUCTOR) {
      colourv k_of;
      spectrum4(looks->spectra, looks->n_columns, of->other_row, band, &k_of);
      for (int k = 0; k < 4; ++k) one.w[k] = conductor_fresnel((realv)1, one.w[k], k_of.w[k]);
    }
#endif
    for (int k = 0; k < 4; ++k) albedo->w[k] = here ? one.w[k] : albedo->w[k];
  }
}

/* survey - the nearest surfaces along n rays, beyond `least`; n is a multiple of WIDTH.
 *
 * Surfaces less than half opaque are looked through. Mixed materials are averaged.
 *
 * rays      planes of origin, unit direction (metres) and least distance
 * distance, object   out: infinite and -1 where nothing is met
 * place     out: planes of position, shading normal towards the eye, and four reflectances from
 *           wavelength `first` on
 */
kernel void survey(const int n, global real *restrict rays, constant world_t *world,
                   constant flat_t *flats, constant ball_t *balls,
                   global const real8 *restrict nodes, global const real8 *restrict blocks,
                   global const int *restrict triangle_object,
                   global const instance_t *restrict instances,
                   global const object_t *restrict objects,
                   global const substance_t *restrict substances,
                   global const texture_t *restrict textures,
                   global const light_t *restrict lights, global const float *restrict texels,
                   global const real *restrict corners, global const real *restrict normals,
                   global const real *restrict uvs, global const real *restrict spectra,
                   const int n_columns, const int first, global real *restrict distance,
                   global int *restrict object, global real *restrict place) {
  const shapes_t shapes = {world, flats, balls, nodes, blocks, triangle_object, instances};
  const triangles_t triangles = {corners, normals, uvs};
  const looks_t looks = {objects, substances, textures, lights, texels, spectra, n_columns};
  const slotsv at = {(int)get_global_id(0) * WIDTH + int_from_uint(lane_numbers()), WIDTH, 1};
  pathv ray;
  read_rays(rays, rays + 3 * (size_t)n, n, &at, &ray);
  realv least = read_plane(rays + 6 * (size_t)n, &at);
  maskv active = ray.dz == ray.dz;
  shape_hitv hit;
  first_hit(&shapes, &ray, least, active, &hit);
#if HAS_CUTOUTS
  for (int pass = 0; pass < MOST_PASSES; ++pass) {
    maskv is_additive;
    realv opacity = opacity_at(&shapes, &triangles, &looks, &ray, &hit, &is_additive);
    maskv open = mask_from_int(hit.object >= 0) & !is_additive & (opacity < R(0.5));
    if (!any_lane(open)) break;
    least = mul_add(hit.distance, (realv)(1 + 16 * ROUNDING), (realv)R(1e-12));
    shape_hitv behind;
    first_hit(&shapes, &ray, least, open, &behind);
    hit.distance = open ? behind.distance : hit.distance;
    hit.object = select_int(open, behind.object, hit.object);
    hit.triangle = select_int(open, behind.triangle, hit.triangle);
    hit.u = open ? behind.u : hit.u;
    hit.v = open ? behind.v : hit.v;
  }
#endif
  bandv band = {(intv)first, (intv)0, 1};
  realv out[10];
  for (int k = 0; k < 10; ++k) out[k] = (realv)0;
  intv left = hit.object;
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    pointv point;
    meet(&shapes, &triangles, objects + number, &ray, &hit, here, (realv)0, &point);
    colourv albedo;
    for (int k = 0; k < 4; ++k) albedo.w[k] = (realv)0;
    if (objects[number].substance >= 0) {
      const int choices = HAS_COMBINED ? 16 : 1;
      for (int i = 0; i < choices; ++i) {
        colourv one;
        realv chance = (i + R(0.5)) / choices;
        intv substance = resolve(&looks, (intv)objects[number].substance, &point, chance);
        albedo4(&looks, substance, &point, &band, &one);
        for (int k = 0; k < 4; ++k) albedo.w[k] += one.w[k] / choices;
      }
    }
    const realv found[10] = {point.x,  point.y,     point.z,     point.sx,    point.sy,
                             point.sz, albedo.w[0], albedo.w[1], albedo.w[2], albedo.w[3]};
    for (int k = 0; k < 10; ++k) out[k] = here ? found[k] : out[k];
  }
  write_plane(hit.distance, distance, &at);
  write_int_plane(hit.object, object, &at);
  for (int k = 0; k < 10; ++k) write_plane(out[k], place + (size_t)k * n, &at);
}

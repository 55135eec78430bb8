/* direct.cl - the direct pipeline: retina, eye and scene in one kernel.
 *
 * For scenes of a few analytic shapes that send out light by themselves. Every work-item owns
 * WIDTH neighbouring pixels and one band of wavelengths; all lanes take the same sample numbers.
 */
#include "lib/camera.cl"
#include "lib/eye.cl"
#include "lib/pixel.cl"
#include "lib/scene.cl"
#include "lib/sobol.cl"

/* radiance - the colour that arrives along rays from the scene. */
INLINE void radiance(rayv ray, constant scene_t *scene, constant patch_t *patches,
                     constant sphere_t *spheres, constant material_t *materials,
                     constant image_t *images, global const uint *texels, realv *colour) {
  hitv hit;
  hit.distance = R(1e30);
#pragma unroll
  for (int k = 0; k < N_BASIS; ++k) hit.colour[k] = scene->background[k];
#if HAS_IMAGES
  hit.image = -1;
  hit.u = 0;
  hit.v = 0;
#endif
  realv x = ray.x * R(1e-3), y = ray.y * R(1e-3), z = ray.z * R(1e-3);
#if HAS_PATCHES
  for (int i = 0; i < scene->n_patches; ++i)
    hit_patch(&hit, patches + i, materials, x, y, z, ray.tx, ray.ty, ray.tz);
#endif
#if HAS_SPHERES
  for (int i = 0; i < scene->n_spheres; ++i)
    hit_sphere(&hit, spheres + i, materials, x, y, z, ray.tx, ray.ty, ray.tz);
#endif
#if HAS_IMAGES
  read_images(&hit, images, scene->n_images, texels);
#endif
#pragma unroll
  for (int k = 0; k < N_BASIS; ++k) colour[k] = hit.colour[k];
}

/* render_direct - the mean over n_samples of irradiance per basis spectrum, for a tile.
 *
 * camera      the retina and its grid, with the tile
 * pupils      one for every band
 * elements    n_elements for every band, retina side first
 * eye_table   numbers of their shapes
 * first, n_samples   sample numbers first ... first + n_samples - 1 of every band
 * block       samples of a band in this replicate: band b takes its points from the b-th block of
 *             the sequence, so that all bands together are one well-spread set
 * stream      hash of seed and replicate
 * film        planes (band, basis) of n_padded pixels; means, mm^2-free: W m^-2 per W m^-2 sr^-1
 */
kernel void render_direct(constant camera_t *camera, constant pupil_t *pupils,
                          constant element_t *elements, const int n_elements,
                          global const real *restrict eye_table, constant scene_t *scene,
                          constant patch_t *patches, constant sphere_t *spheres,
                          constant material_t *materials, constant image_t *images,
                          global const uint *restrict texels,
                          const uint first, const uint n_samples, const uint block,
                          const uint stream, const int n_padded, global real *restrict film) {
  const size_t group = get_global_id(0);
  const uint band = get_global_id(1);
  constant pupil_t *pupil = pupils + band;
  constant element_t *sequence = elements + band * n_elements;
  uintv pixel = (uint)(group * WIDTH) + lane_numbers();
  uintv row = pixel / (uint)camera->tile_width;
  uintv column = pixel - row * (uint)camera->tile_width;
  row += (uint)camera->tile_y;
  column += (uint)camera->tile_x;
  uintv pixel_stream = mix_bits(mix_bits(row * (uint)camera->image_width + column) + stream);
  pixelv place;
  pixel_at(camera, eye_table, row, column, &place);
  realv sum[N_BASIS];
#pragma unroll
  for (int k = 0; k < N_BASIS; ++k) sum[k] = 0;
  for (uint i = 0; i < n_samples; ++i) {
    const uint sample = band * block + first + i;
    /* The first two dimensions are the best spread; the pupil needs them most. */
    realv u = sobol_coordinate(sample, 0, pixel_stream);
    realv v = sobol_coordinate(sample, 1, pixel_stream);
    realv gx, gy;
    point_in_pixel(camera, &place, sobol_coordinate(sample, 2, pixel_stream),
                   sobol_coordinate(sample, 3, pixel_stream), &gx, &gy);
    rayv ray;
    realv weight = aim_from_retina(camera, pupil, elements, eye_table, gx, gy, u, v, &ray);
    bendsv bends;
    draw_bends(sample, pixel_stream, &bends);
    maskv passed = leave_eye(&ray, sequence, n_elements, eye_table, &bends);
    weight = passed ? weight : (realv)0;
    realv colour[N_BASIS];
#if HAS_SPHERES
    /* Spheres need unit directions; in air they are so already. */
    ray.tx *= pupil->inverse_object_index;
    ray.ty *= pupil->inverse_object_index;
    ray.tz *= pupil->inverse_object_index;
#endif
    radiance(ray, scene, patches, spheres, materials, images, texels, colour);
#pragma unroll
    for (int k = 0; k < N_BASIS; ++k) sum[k] = mul_add(weight, colour[k], sum[k]);
  }
  const real scale = R(1.0) / n_samples;
#pragma unroll
  for (int k = 0; k < N_BASIS; ++k)
    store_lanes(sum[k] * scale, film + ((size_t)band * N_BASIS + k) * n_padded, group);
}

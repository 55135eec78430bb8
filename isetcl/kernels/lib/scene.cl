/* scene.cl - the radiance that reaches the eye along a ray, from a few analytic shapes.
 *
 * Lengths in metres, relative to the corneal vertex. A colour is a set of coefficients of the
 * N_BASIS spectra of the scene. What a scene does not have is not compiled.
 */
#include "lib/real.cl"
#include "lib/turn.cl"

/* hitv - the nearest hit so far. */
typedef struct {
  realv distance;
  realv colour[N_BASIS];
#if HAS_IMAGES
  intv image; /* image material whose texture is still to be read, -1 if none */
  realv u, v;
#endif
} hitv;

/* hit_material - puts the material of a shape into the lanes that hit it.
 *
 * u, v   texture coordinates in the shape, 0 to 1
 */
INLINE void hit_material(hitv *hit, constant material_t *material, maskv here, realv distance,
                         realv u, realv v) {
  hit->distance = here ? distance : hit->distance;
#if HAS_CHECKERBOARDS
  maskv second = (maskv)(0);
  if (material->kind == MATERIAL_CHECKERBOARD) {
    intv parity = whole(u * material->periods_u) + whole(v * material->periods_v);
    second = here & mask_from_int((parity & 1) != 0);
  }
#endif
#pragma unroll
  for (int k = 0; k < N_BASIS; ++k) {
    hit->colour[k] = here ? (realv)material->first[k] : hit->colour[k];
#if HAS_CHECKERBOARDS
    hit->colour[k] = second ? (realv)material->second[k] : hit->colour[k];
#endif
  }
#if HAS_IMAGES
  const int image = material->kind == MATERIAL_IMAGE ? material->image : -1;
  hit->image = int_from_mask(here) ? (intv)image : hit->image;
  hit->u = here ? u : hit->u;
  hit->v = here ? v : hit->v;
#endif
}

#if HAS_PATCHES
/* hit_patch - a parallelogram, or the ellipse inscribed in it.
 *
 * Points of its plane have u = axis_u . p + offset_u and v alike, both in [0, 1) inside.
 */
INLINE void hit_patch(hitv *hit, constant patch_t *patch, constant material_t *materials, realv x,
                      realv y, realv z, realv dx, realv dy, realv dz) {
  realv height = mul_add((realv)-patch->normal[0], x,
                         mul_add((realv)-patch->normal[1], y,
                                 mul_add((realv)-patch->normal[2], z, (realv)patch->offset)));
  realv descent = mul_add((realv)patch->normal[0], dx,
                          mul_add((realv)patch->normal[1], dy, patch->normal[2] * dz));
  realv distance = height / descent;
  realv px = mul_add(distance, dx, x);
  realv py = mul_add(distance, dy, y);
  realv pz = mul_add(distance, dz, z);
  realv u = mul_add((realv)patch->axis_u[0], px,
                    mul_add((realv)patch->axis_u[1], py,
                            mul_add((realv)patch->axis_u[2], pz, (realv)patch->offset_u)));
  realv v = mul_add((realv)patch->axis_v[0], px,
                    mul_add((realv)patch->axis_v[1], py,
                            mul_add((realv)patch->axis_v[2], pz, (realv)patch->offset_v)));
  maskv inside = (u >= 0) & (u < 1) & (v >= 0) & (v < 1);
#if HAS_DISCS
  if (patch->is_round) {
    realv a = u - R(0.5), b = v - R(0.5);
    inside = mul_add(a, a, b * b) < R(0.25);
  }
#endif
  maskv here = inside & (distance > 0) & (distance < hit->distance * COINCIDENT);
  hit_material(hit, materials + patch->material, here, distance, u, v);
}
#endif

#if HAS_SPHERES
/* hit_sphere - a sphere, from outside or inside.
 *
 * The ray is first moved to its point of closest approach to the centre, so that small or distant
 * spheres are neither missed nor enlarged by rounding.  Texture: longitude and latitude about y.
 */
INLINE void hit_sphere(hitv *hit, constant sphere_t *sphere, constant material_t *materials,
                       realv x, realv y, realv z, realv dx, realv dy, realv dz) {
  realv ox = x - sphere->centre[0], oy = y - sphere->centre[1], oz = z - sphere->centre[2];
  realv nearest = -mul_add(ox, dx, mul_add(oy, dy, oz * dz));
  realv px = mul_add(nearest, dx, ox), py = mul_add(nearest, dy, oy),
        pz = mul_add(nearest, dz, oz);
  realv half2 = sphere->radius2 - mul_add(px, px, mul_add(py, py, pz * pz));
  maskv met = half2 > 0;
  realv half_chord = square_root(met ? half2 : (realv)0);
  realv distance = nearest - half_chord;
  realv side = -half_chord;
  maskv inside = distance <= 0;
  distance = inside ? nearest + half_chord : distance;
  side = inside ? half_chord : side;
  maskv here = met & (distance > 0) & (distance < hit->distance * COINCIDENT);
  realv u = 0, v = 0;
#if HAS_TEXTURED_SPHERES
  if (materials[sphere->material].kind != MATERIAL_UNIFORM) {
    realv nx = mul_add(side, dx, px), ny = mul_add(side, dy, py), nz = mul_add(side, dz, pz);
    u = turn_of(nx, nz);
    u = u < 0 ? u + 1 : u;
    v = mul_add((realv)2, turn_of(ny, square_root(mul_add(nx, nx, nz * nz))), (realv)R(0.5));
  }
#endif
  hit_material(hit, materials + sphere->material, here, distance, u, v);
}
#endif

#if HAS_IMAGES
/* texel - one channel word of a texture in every lane. */
INLINE uintv texel(global const uint *texels, intv at) {
#if WIDTH == 1
  return texels[at];
#else
  uintv word;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) word[i] = texels[at[i]];
  return word;
#endif
}

#if TEXTURE_CHANNELS == 1 || !TEXTURE_PACKED
INLINE realv float_texel(global const uint *texels, intv at) {
  uintv word = texel(texels, at);
#if WIDTH == 1
  return as_float(word);
#else
  return real_from_float(__builtin_astype(word, floatv));
#endif
}
#endif

/* texel_colour - the channels of a texel, 0 to 1 (times the texture's scale).
 *
 * TEXTURE_PACKED: one word of 11, 11 and 10 bits; otherwise one float a channel.
 */
INLINE void texel_colour(global const uint *texels, intv at, realv *channel) {
#if TEXTURE_CHANNELS == 1
  channel[0] = float_texel(texels, at);
#elif TEXTURE_PACKED
  uintv word = texel(texels, at);
  channel[0] = real_from_int(int_from_uint(word & 0x7ffu)) * R(4.88519785051294577e-4);
  channel[1] = real_from_int(int_from_uint((word >> 11) & 0x7ffu)) * R(4.88519785051294577e-4);
  channel[2] = real_from_int(int_from_uint(word >> 22)) * R(9.77517106549364614e-4);
#else
  for (int c = 0; c < TEXTURE_CHANNELS; ++c) channel[c] = float_texel(texels, 3 * at + c);
#endif
}

/* read_images - replaces the colour of lanes that hit an image by its bilinear interpolation.
 *
 * Images have a border of one repeated texel, so that no index needs clamping.
 */
INLINE void read_images(hitv *hit, constant image_t *images, int n_images,
                        global const uint *texels) {
  realv column = 0, row = 0;
  intv base = 0, stride = 0;
  for (int i = 0; i < n_images; ++i) {
    maskv here = mask_from_int(hit->image == i);
    column = here ? mul_add(hit->u, (realv)images[i].width, (realv)R(0.5)) : column;
    row = here ? mul_add((realv)-hit->v, (realv)images[i].height,
                         (realv)(images[i].height + R(0.5)))
               : row;
    base = int_from_mask(here) ? (intv)images[i].first : base;
    stride = int_from_mask(here) ? (intv)images[i].stride : stride;
  }
  intv left = int_from_real(column), top = int_from_real(row);
  realv right_part = column - real_from_int(left), low_part = row - real_from_int(top);
  intv at = base + top * stride + left;
  realv a[TEXTURE_CHANNELS], b[TEXTURE_CHANNELS], c[TEXTURE_CHANNELS], d[TEXTURE_CHANNELS];
  texel_colour(texels, at, a);
  texel_colour(texels, at + 1, b);
  texel_colour(texels, at + stride, c);
  texel_colour(texels, at + stride + 1, d);
#pragma unroll
  for (int i = 0; i < TEXTURE_CHANNELS; ++i) {
    realv upper = mul_add(right_part, b[i] - a[i], a[i]);
    realv lower = mul_add(right_part, d[i] - c[i], c[i]);
    a[i] = mul_add(low_part, lower - upper, upper);
  }
  for (int i = 0; i < n_images; ++i) {
    maskv here = mask_from_int(hit->image == i);
#pragma unroll
    for (int k = 0; k < N_BASIS; ++k) {
      realv sum = a[0] * images[i].colour[k];
#pragma unroll
      for (int j = 1; j < TEXTURE_CHANNELS; ++j)
        sum = mul_add(a[j], (realv)images[i].colour[j * N_BASIS + k], sum);
      hit->colour[k] = here ? sum : hit->colour[k];
    }
  }
}
#endif

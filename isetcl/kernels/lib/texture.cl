/* texture.cl - weights of textures, and spectra weighted by them.
 */
#include "lib/lanes.cl"

/* Pictures make the functions of textures long. */
#if HAS_PICTURES
#define TEXTURING SHARED
#else
#define TEXTURING INLINE
#endif

/* A bundle of paths that stays in the memory of a work-group belongs to one band. */
#define ONE_BAND PATHS_ARE_LOCAL

/* bandv - where the four wavelengths of every lane begin in the rows of the table of spectra.
 *
 * is_same   whether all lanes have the same, so that values are read once
 */
typedef struct {
  intv first, number;
  int is_same;
} bandv;

/* spectrum4 - the four wavelengths of a row of the table of spectra. */
INLINE void spectrum4(global const real *spectra, int n_columns, int row, const bandv *band,
                      colourv *value) {
  global const real *at = spectra + (size_t)row * n_columns;
  if (ONE_BAND || band->is_same) {
    at += LANE(band->first, 0);
    for (int k = 0; k < 4; ++k) value->w[k] = (realv)at[k];
    return;
  }
#if !ONE_BAND
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) {
    global const real *of_lane = at + LANE(band->first, i);
    for (int k = 0; k < 4; ++k) LANE(value->w[k], i) = of_lane[k];
  }
#endif
}

/* band_value - the value of each lane's band in a row that holds one value a band. */
INLINE realv band_value(global const real *spectra, int n_columns, int row, const bandv *band) {
  global const real *at = spectra + (size_t)row * n_columns;
  if (ONE_BAND || band->is_same) return (realv)at[LANE(band->number, 0)];
  realv value = 0;
#if !ONE_BAND
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) LANE(value, i) = at[LANE(band->number, i)];
#endif
  return value;
}

/* part_of_whole - a number less the largest integer below it; 0 beyond the range of integers. */
INLINE realv part_of_whole(realv x) {
  maskv is_small = magnitude(x) < R(2e9);
  realv kept = is_small ? x : (realv)0;
  return kept - real_from_int(whole(kept));
}

/* Places on a texture: coordinates, and the width of the ray there in their units. */
typedef struct {
  realv u, v, width_u, width_v;
} placev;

#if HAS_PICTURES || HAS_LIGHT_FIELDS
/* The four texels around a place in a picture, and how near it lies to them. */
typedef struct {
  intv left_top, right_top, left_low, right_low;
  intv plane; /* texels of a channel */
  realv right, low;
} texelsv;

/* wrap_index - an index of at most one beyond 0 ... n - 1 brought into it, by repeating or by
 * stopping at the border.
 */
INLINE intv wrap_index(intv i, intv n, int repeats) {
  if (repeats) i = i < 0 ? i + n : i > n - 1 ? i - n : i;
  return i < 0 ? (intv)0 : i > n - 1 ? n - 1 : i;
}

/* find_texels - the texels around a place, bilinear between their centres.
 *
 * A picture with levels is read where MOST_TEXELS or fewer lie across the ray (HAS_LEVELS): level l
 * is the picture averaged down l times by two.
 */
INLINE void find_texels(global const texture_t *texture, const placev *place, texelsv *texels) {
  intv width = (intv)texture->width, height = (intv)texture->height, first = (intv)texture->first;
#if HAS_LEVELS
  if (texture->levels > 1) {
    realv across = smaller(place->width_u * real_from_int(width) * magnitude1(texture->periods_u),
                           place->width_v * real_from_int(height) * magnitude1(texture->periods_v));
    intv level = 0;
    for (int l = 1; l < texture->levels; ++l)
      level = int_from_mask(across >= (real)(MOST_TEXELS << l)) ? (intv)l : level;
#pragma unroll
    for (int i = 0; i < WIDTH; ++i) {
      const int l = LANE(level, i);
      LANE(width, i) = texture->width >> l > 1 ? texture->width >> l : 1;
      LANE(height, i) = texture->height >> l > 1 ? texture->height >> l : 1;
      LANE(first, i) = texture->level_first[l];
    }
  }
#endif
  realv columns = real_from_int(width), rows = real_from_int(height);
  realv s = mul_add(place->u, (realv)texture->periods_u, (realv)texture->offset_u);
  realv t = mul_add(place->v, (realv)texture->periods_v, (realv)texture->offset_v);
  if (texture->repeats) s = part_of_whole(s), t = part_of_whole(t);
  realv x = mul_add(s, columns, (realv)R(-0.5)), y = mul_add(1 - t, rows, (realv)R(-0.5));
  if (!texture->repeats) {
    x = smaller(larger(x, (realv)0), columns - 1);
    y = smaller(larger(y, (realv)0), rows - 1);
  }
  intv column = whole(x), row = whole(y);
  texels->right = x - real_from_int(column);
  texels->low = y - real_from_int(row);
  intv left = wrap_index(column, width, texture->repeats);
  intv right = wrap_index(column + 1, width, texture->repeats);
  intv top = wrap_index(row, height, texture->repeats) * width + first;
  intv low = wrap_index(row + 1, height, texture->repeats) * width + first;
  texels->left_top = top + left, texels->right_top = top + right;
  texels->left_low = low + left, texels->right_low = low + right;
  texels->plane = width * height;
}

INLINE realv one_texel(global const float *texels, intv at) {
  realv value;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) LANE(value, i) = texels[LANE(at, i)];
  return value;
}

/* between_texels - a channel between four texels; channels lie in planes, one after the other. */
INLINE realv between_texels(global const float *texels, const texelsv *at, int channel) {
  intv offset = at->plane * channel;
  realv a = one_texel(texels, at->left_top + offset);
  realv b = one_texel(texels, at->right_top + offset);
  realv c = one_texel(texels, at->left_low + offset);
  realv d = one_texel(texels, at->right_low + offset);
  realv upper = mul_add(at->right, b - a, a), lower = mul_add(at->right, d - c, c);
  return mul_add(at->low, lower - upper, upper);
}
#endif

#if HAS_LIGHT_FIELDS
/* light_field4 - radiance that differs by direction: boxes of pixels, bilinear between their views.
 *
 * slope_x, slope_y   of the light that leaves along u and v, in units of the outermost slopes
 */
SHARED void light_field4(global const texture_t *texture, global const float *texels,
                         global const real *spectra, int n_columns, int row, const bandv *band,
                         realv u, realv v, realv slope_x, realv slope_y, colourv *value) {
  const int columns = texture->width, rows = texture->height;
  const int across = texture->views_x, up = texture->views_y;
  intv column = wrap_index(whole(u * columns), columns, 0);
  intv line = wrap_index(whole((1 - v) * rows), rows, 0);
  realv a = mul_add(slope_x + 1, (realv)(R(0.5) * across), (realv)R(-0.5));
  realv b = mul_add(1 - slope_y, (realv)(R(0.5) * up), (realv)R(-0.5));
  a = smaller(larger(a, (realv)0), (realv)(across - 1));
  b = smaller(larger(b, (realv)0), (realv)(up - 1));
  intv left = wrap_index(whole(a), across, 0), top = wrap_index(whole(b), up, 0);
  intv right = wrap_index(left + 1, across, 0), low = wrap_index(top + 1, up, 0);
  intv first = texture->first + (line * columns + column) * (up * across);
  texelsv at = {first + top * across + left, first + top * across + right,
                first + low * across + left, first + low * across + right,
                (intv)(columns * rows * across * up), a - real_from_int(left),
                b - real_from_int(top)};
  maskv seen = (magnitude(slope_x) <= 1) & (magnitude(slope_y) <= 1);
  for (int c = 0; c < texture->channels; ++c) {
    colourv of_channel;
    spectrum4(spectra, n_columns, row + c, band, &of_channel);
    realv weight = seen ? between_texels(texels, &at, c) : (realv)0;
    for (int k = 0; k < 4; ++k)
      value->w[k] = c == 0 ? weight * of_channel.w[k]
                           : mul_add(weight, of_channel.w[k], value->w[k]);
  }
}
#endif

/* pattern_weight - the weight of a checkerboard or a grid of lines. */
INLINE realv pattern_weight(global const texture_t *texture, realv u, realv v) {
  realv a = u * texture->periods_u, b = v * texture->periods_v;
#if HAS_GRIDS
  if (texture->kind == TEXTURE_GRID) {
    a = part_of_whole(a + texture->line_width / 2);
    b = part_of_whole(b + texture->line_width / 2);
    maskv on_line = (a < texture->line_width) | (b < texture->line_width);
    return on_line ? (realv)texture->bright : (realv)texture->dark;
  }
#endif
  intv parity = whole(2 * part_of_whole(a / 2)) + whole(2 * part_of_whole(b / 2));
  return mask_from_int((parity & 1) != 0) ? (realv)texture->dark : (realv)texture->bright;
}

/* grey_weight - the weight of a texture of one channel. */
TEXTURING realv grey_weight(global const texture_t *texture, global const float *texels,
                         const placev *place) {
#if HAS_PICTURES
  if (texture->kind == TEXTURE_IMAGE) {
    texelsv at;
    find_texels(texture, place, &at);
    return between_texels(texels, &at, 0);
  }
#endif
  return pattern_weight(texture, place->u, place->v);
}

/* textured4 - a spectrum, or one a channel, weighted by a texture: radiance or reflectance.
 *
 * number   of the texture, -1 for none
 */
TEXTURING void textured4(global const texture_t *textures, int number, global const float *texels,
                      global const real *spectra, int n_columns, int row, const bandv *band,
                      const placev *place, colourv *value) {
  spectrum4(spectra, n_columns, row, band, value);
  if (number < 0) return;
  global const texture_t *texture = textures + number;
#if HAS_PICTURES
  if (texture->kind == TEXTURE_IMAGE) {
    texelsv at;
    find_texels(texture, place, &at);
    realv weight = between_texels(texels, &at, 0);
    for (int k = 0; k < 4; ++k) value->w[k] *= weight;
    for (int c = 1; c < texture->channels; ++c) {
      colourv more;
      spectrum4(spectra, n_columns, row + c, band, &more);
      weight = between_texels(texels, &at, c);
      for (int k = 0; k < 4; ++k) value->w[k] = mul_add(weight, more.w[k], value->w[k]);
    }
    return;
  }
#endif
  realv weight = pattern_weight(texture, place->u, place->v);
  for (int k = 0; k < 4; ++k) value->w[k] *= weight;
}

/* surface.cl - where a path met something: the point, its normals, and what the surface is made of.
 */
#include "lib/shapes.cl"

/* A point of a surface. The normals face the side the path came from. */
typedef struct {
  real x, y, z;
  real nx, ny, nz; /* geometric normal */
  real sx, sy, sz; /* shading normal */
  real u, v;       /* texture coordinates */
} point_t;

/* wavelengths4 - four neighbouring values of a row of the table of spectra. */
INLINE real4 wavelengths4(global const real *spectra, int n_columns, int row, int first) {
  global const real *at = spectra + (size_t)row * n_columns + first;
  return (real4)(at[0], at[1], at[2], at[3]);
}

#if HAS_TEXTURED_BALLS
/* turn_of_vector - the angle of (x, y) in turns, -1/2 to 1/2. */
INLINE real turn_of_vector(real y, real x) { return atan2(y, x) * R(0.15915494309189533577); }
#endif

#if HAS_PICTURES
/* picture_weight - channel `c` of a picture, bilinear between the centres of its texels. */
INLINE real picture_weight(constant picture_t *picture, global const float *texels, real u, real v,
                           int c) {
  real column = u * picture->width - R(0.5), row = (1 - v) * picture->height - R(0.5);
  column = column < 0 ? 0 : column > picture->width - 1 ? picture->width - 1 : column;
  row = row < 0 ? 0 : row > picture->height - 1 ? picture->height - 1 : row;
  const int left = (int)column, top = (int)row;
  const int right = left + 1 < (int)picture->width ? left + 1 : left;
  const int low = top + 1 < (int)picture->height ? top + 1 : top;
  const real fx = column - left, fy = row - top;
  const int n = picture->channels, stride = (int)picture->width * n;
  global const float *at = texels + picture->first + c;
  const real upper = at[top * stride + left * n] * (1 - fx) + at[top * stride + right * n] * fx;
  const real lower = at[low * stride + left * n] * (1 - fx) + at[low * stride + right * n] * fx;
  return upper * (1 - fy) + lower * fy;
}
#endif

/* textured4 - a spectrum or three, weighted by a material's texture: radiance or reflectance. */
INLINE real4 textured4(constant substance_t *substance, int row, real u, real v,
                       constant picture_t *pictures, global const float *texels,
                       global const real *spectra, int n_columns, int first) {
  real4 value = wavelengths4(spectra, n_columns, row, first);
  if (substance->kind == MATERIAL_CHECKERBOARD) {
    const real a = u * substance->periods_u, b = v * substance->periods_v;
    const int parity = (int)(a < 0 ? a - 1 : a) + (int)(b < 0 ? b - 1 : b);
    value *= parity & 1 ? substance->dark : substance->bright;
  }
#if HAS_PICTURES
  if (substance->kind == MATERIAL_IMAGE) {
    constant picture_t *picture = pictures + substance->picture;
    const real pu = u < 0 ? 0 : u > 1 ? 1 : u, pv = v < 0 ? 0 : v > 1 ? 1 : v;
    value *= picture_weight(picture, texels, pu, pv, 0);
    for (int c = 1; c < picture->channels; ++c)
      value += wavelengths4(spectra, n_columns, row + c, first) *
               picture_weight(picture, texels, pu, pv, c);
  }
#endif
  return value;
}

/* meet - the point of the scene a ray hit. */
INLINE void meet(real ox, real oy, real oz, real dx, real dy, real dz, const shape_hit_t *hit,
                 constant object_t *objects, constant flat_t *flats, constant ball_t *balls,
                 constant substance_t *substances, global const real *corners,
                 global const real *normals, global const real *uvs, point_t *point) {
  constant object_t *object = objects + hit->object;
  point->u = hit->u;
  point->v = hit->v;
#if HAS_FLATS
  if (object->kind == SHAPE_FLAT) {
    constant flat_t *flat = flats + object->first;
    point->x = flat->corner[0] + hit->u * flat->edge_u[0] + hit->v * flat->edge_v[0];
    point->y = flat->corner[1] + hit->u * flat->edge_u[1] + hit->v * flat->edge_v[1];
    point->z = flat->corner[2] + hit->u * flat->edge_u[2] + hit->v * flat->edge_v[2];
    point->nx = flat->normal[0], point->ny = flat->normal[1], point->nz = flat->normal[2];
  }
#endif
#if HAS_BALLS
  if (object->kind == SHAPE_BALL) {
    constant ball_t *ball = balls + object->first;
    const real x = ox + hit->distance * dx - ball->centre[0];
    const real y = oy + hit->distance * dy - ball->centre[1];
    const real z = oz + hit->distance * dz - ball->centre[2];
    const real inverse = 1 / scalar_root(dot3(x, y, z, x, y, z));
    point->nx = x * inverse, point->ny = y * inverse, point->nz = z * inverse;
    point->x = ball->centre[0] + ball->radius * point->nx;
    point->y = ball->centre[1] + ball->radius * point->ny;
    point->z = ball->centre[2] + ball->radius * point->nz;
#if HAS_TEXTURED_BALLS
    if (substances[object->substance].kind != MATERIAL_UNIFORM) {
      const real turn = turn_of_vector(point->nx, point->nz);
      point->u = turn < 0 ? turn + 1 : turn;
      point->v = R(0.5) + turn_of_vector(point->ny, scalar_root(point->nx * point->nx +
                                                              point->nz * point->nz));
    }
#endif
  }
#endif
  point->sx = point->nx, point->sy = point->ny, point->sz = point->nz;
#if HAS_MESHES
  if (object->kind == SHAPE_MESH) {
    const real b = hit->u, c = hit->v, a = 1 - b - c;
    global const real *at = corners + 9 * (size_t)hit->triangle;
    point->x = a * at[0] + b * at[3] + c * at[6];
    point->y = a * at[1] + b * at[4] + c * at[7];
    point->z = a * at[2] + b * at[5] + c * at[8];
    const real e1x = at[3] - at[0], e1y = at[4] - at[1], e1z = at[5] - at[2];
    const real e2x = at[6] - at[0], e2y = at[7] - at[1], e2z = at[8] - at[2];
    const real nx = e1y * e2z - e1z * e2y, ny = e1z * e2x - e1x * e2z, nz = e1x * e2y - e1y * e2x;
    const real inverse = 1 / scalar_root(dot3(nx, ny, nz, nx, ny, nz));
    point->nx = nx * inverse, point->ny = ny * inverse, point->nz = nz * inverse;
    point->sx = point->nx, point->sy = point->ny, point->sz = point->nz;
    point->u = point->v = 0;
#if HAS_UV
    global const real *uv = uvs + 6 * (size_t)hit->triangle;
    point->u = a * uv[0] + b * uv[2] + c * uv[4];
    point->v = a * uv[1] + b * uv[3] + c * uv[5];
#endif
#if HAS_NORMALS
    if (object->is_smooth) {
      global const real *n = normals + 9 * (size_t)hit->triangle;
      const real x = a * n[0] + b * n[3] + c * n[6];
      const real y = a * n[1] + b * n[4] + c * n[7];
      const real z = a * n[2] + b * n[5] + c * n[8];
      const real length2 = dot3(x, y, z, x, y, z);
      if (length2 > 0) {
        const real scale = 1 / scalar_root(length2);
        point->sx = x * scale, point->sy = y * scale, point->sz = z * scale;
      }
    }
#endif
  }
#endif
  /* Both normals face the ray; a shading normal that cannot is replaced. */
  if (dot3(point->nx, point->ny, point->nz, dx, dy, dz) > 0)
    point->nx = -point->nx, point->ny = -point->ny, point->nz = -point->nz;
  if (dot3(point->sx, point->sy, point->sz, point->nx, point->ny, point->nz) < 0)
    point->sx = -point->sx, point->sy = -point->sy, point->sz = -point->sz;
  if (!(dot3(point->sx, point->sy, point->sz, dx, dy, dz) < 0))
    point->sx = point->nx, point->sy = point->ny, point->sz = point->nz;
}

/* step_off - how far from a surface point a ray must start not to meet the surface again. */
INLINE real step_off(const point_t *point) {
  const real x = point->x < 0 ? -point->x : point->x, y = point->y < 0 ? -point->y : point->y,
             z = point->z < 0 ? -point->z : point->z;
  const real most = x > y ? (x > z ? x : z) : (y > z ? y : z);
  return most * (ROUNDING * 8) + R(1e-12);
}

/* surface.cl - where rays met something: points, normals, texture coordinates.
 */
#include "lib/disc.cl"
#include "lib/frame.cl"
#include "lib/shapes.cl"
#include "lib/texture.cl"
#include "lib/turn.cl"

/* Points of surfaces. The normals face the side the rays came from. */
typedef struct {
  realv x, y, z;
  realv nx, ny, nz; /* geometric normal */
  realv sx, sy, sz; /* shading normal */
  placev at;        /* on the textures */
  realv reach;      /* the largest coordinate that the place was computed from */
  maskv is_front;   /* whether the rays came from the side the surface faces */
} pointv;

/* What surfaces of meshes are made of: 9 reals (corners, normals) or 6 (u, v) a triangle. */
typedef struct {
  global const real *corners;
  global const real *normals;
  global const real *uvs;
} triangles_t;

INLINE realv normalised(realv *x, realv *y, realv *z) {
  realv length = square_root(dot3(*x, *y, *z, *x, *y, *z));
  realv inverse = 1 / length;
  *x *= inverse, *y *= inverse, *z *= inverse;
  return length;
}

INLINE realv largest3(realv x, realv y, realv z) {
  return larger(magnitude(x), larger(magnitude(y), magnitude(z)));
}

#if HAS_MESHES
/* unit_normal - a vector of any length, whose square may be too large or too small, made a unit. */
INLINE void unit_normal(realv *x, realv *y, realv *z) {
  realv inverse = 1 / larger(largest3(*x, *y, *z), (realv)R(1e-37));
  *x *= inverse, *y *= inverse, *z *= inverse;
  normalised(x, y, z);
}

INLINE realv of_triangle(global const real *table, intv triangle, int stride, int part) {
  realv value;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i)
    LANE(value, i) = table[(size_t)LANE(triangle, i) * stride + part];
  return value;
}

/* triangle_point - a point of a triangle by its weights b and c, its normal (twice the area long)
 * and its texture coordinates, in the frame of the mesh.
 */
INLINE void triangle_point(const triangles_t *t, intv triangle, realv b, realv c, pointv *point) {
  realv corner[9];
#pragma unroll
  for (int k = 0; k < 9; ++k) corner[k] = of_triangle(t->corners, triangle, 9, k);
  realv e1x = corner[3] - corner[0], e1y = corner[4] - corner[1], e1z = corner[5] - corner[2];
  realv e2x = corner[6] - corner[0], e2y = corner[7] - corner[1], e2z = corner[8] - corner[2];
  point->x = mul_add(b, e1x, mul_add(c, e2x, corner[0]));
  point->y = mul_add(b, e1y, mul_add(c, e2y, corner[1]));
  point->z = mul_add(b, e1z, mul_add(c, e2z, corner[2]));
  point->nx = mul_add(e1y, e2z, -(e1z * e2y));
  point->ny = mul_add(e1z, e2x, -(e1x * e2z));
  point->nz = mul_add(e1x, e2y, -(e1y * e2x));
  point->reach = largest3(corner[0], corner[1], corner[2]);
  point->reach = larger(point->reach, largest3(corner[3], corner[4], corner[5]));
  point->reach = larger(point->reach, largest3(corner[6], corner[7], corner[8]));
  point->at.u = point->at.v = (realv)0;
#if HAS_UV
  realv a = 1 - b - c;
  realv uv[6];
#pragma unroll
  for (int k = 0; k < 6; ++k) uv[k] = of_triangle(t->uvs, triangle, 6, k);
  point->at.u = mul_add(a, uv[0], mul_add(b, uv[2], c * uv[4]));
  point->at.v = mul_add(a, uv[1], mul_add(b, uv[3], c * uv[5]));
#if HAS_LEVELS
  /* Texture coordinates a metre, from the areas of the triangle in both. */
  realv area_uv = mul_add(uv[2] - uv[0], uv[5] - uv[1], -((uv[4] - uv[0]) * (uv[3] - uv[1])));
  realv area2 = dot3(point->nx, point->ny, point->nz, point->nx, point->ny, point->nz);
  realv scale = square_root(magnitude(area_uv) / square_root(larger(area2, (realv)R(1e-30))));
  point->at.width_u *= scale, point->at.width_v *= scale;
#endif
#endif
}

#if HAS_NORMALS
/* triangle_normal - the interpolated shading normal, or the geometric one where there is none. */
INLINE void triangle_normal(const triangles_t *t, intv triangle, realv b, realv c, pointv *point) {
  realv n[9], a = 1 - b - c;
#pragma unroll
  for (int k = 0; k < 9; ++k) n[k] = of_triangle(t->normals, triangle, 9, k);
  realv x = mul_add(a, n[0], mul_add(b, n[3], c * n[6]));
  realv y = mul_add(a, n[1], mul_add(b, n[4], c * n[7]));
  realv z = mul_add(a, n[2], mul_add(b, n[5], c * n[8]));
  maskv known = dot3(x, y, z, x, y, z) > 0;
  point->sx = known ? x : point->nx;
  point->sy = known ? y : point->ny;
  point->sz = known ? z : point->nz;
}
#endif

#if HAS_INSTANCES
/* place_point - a point and its normals from the frame of a mesh to that of the world. */
INLINE void place_point(global const instance_t *instance, pointv *p) {
  global const real *m = instance->matrix, *w = instance->inverse;
  realv x = p->x, y = p->y, z = p->z;
  p->x = mul_add(x, (realv)m[0], mul_add(y, (realv)m[1], mul_add(z, (realv)m[2], (realv)m[3])));
  p->y = mul_add(x, (realv)m[4], mul_add(y, (realv)m[5], mul_add(z, (realv)m[6], (realv)m[7])));
  p->z = mul_add(x, (realv)m[8], mul_add(y, (realv)m[9], mul_add(z, (realv)m[10], (realv)m[11])));
  real grown = 0, shift = 0;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    global const real *row = m + 4 * k;
    const real sum = fabs(row[0]) + fabs(row[1]) + fabs(row[2]), to = fabs(row[3]);
    grown = sum > grown ? sum : grown, shift = to > shift ? to : shift;
  }
  p->reach = mul_add(p->reach, (realv)grown, (realv)shift);
  x = p->nx, y = p->ny, z = p->nz;
  p->nx = dot3(x, y, z, (realv)w[0], (realv)w[4], (realv)w[8]);
  p->ny = dot3(x, y, z, (realv)w[1], (realv)w[5], (realv)w[9]);
  p->nz = dot3(x, y, z, (realv)w[2], (realv)w[6], (realv)w[10]);
  x = p->sx, y = p->sy, z = p->sz;
  p->sx = dot3(x, y, z, (realv)w[0], (realv)w[4], (realv)w[8]);
  p->sy = dot3(x, y, z, (realv)w[1], (realv)w[5], (realv)w[9]);
  p->sz = dot3(x, y, z, (realv)w[2], (realv)w[6], (realv)w[10]);
}
#endif
#endif

/* meet - the points of one object that rays hit.
 *
 * width   of the rays there, metres
 */
INLINE void meet(const shapes_t *shapes, const triangles_t *triangles,
                 global const object_t *object, const pathv *ray, const shape_hitv *hit,
                 maskv here, realv width, pointv *point) {
  point->at.width_u = width * object->turns_u;
  point->at.width_v = width * object->turns_v;
  point->at.u = hit->u;
  point->at.v = hit->v;
#if HAS_FLATS
  if (object->kind == SHAPE_FLAT) {
    constant flat_t *flat = shapes->flats + object->first;
    realv nx = flat->normal[0], ny = flat->normal[1], nz = flat->normal[2];
    realv distance = here ? hit->distance : (realv)1;
    realv x = mul_add(distance, ray->dx, ray->ox), y = mul_add(distance, ray->dy, ray->oy),
          z = mul_add(distance, ray->dz, ray->oz);
    /* Back onto the plane: a place made of edges would be as wrong as these are long. */
    realv above = dot3(nx, ny, nz, x - flat->foot[0], y - flat->foot[1], z - flat->foot[2]);
    point->x = mul_add(-above, nx, x), point->y = mul_add(-above, ny, y);
    point->z = mul_add(-above, nz, z);
    point->nx = nx, point->ny = ny, point->nz = nz;
    point->reach = largest3(point->x, point->y, point->z);
  }
#endif
#if HAS_BALLS
  if (object->kind == SHAPE_BALL) {
    constant ball_t *ball = shapes->balls + object->first;
    realv distance = here ? hit->distance : (realv)1;
    realv x = mul_add(distance, ray->dx, ray->ox - ball->centre[0]);
    realv y = mul_add(distance, ray->dy, ray->oy - ball->centre[1]);
    realv z = mul_add(distance, ray->dz, ray->oz - ball->centre[2]);
    normalised(&x, &y, &z);
    point->nx = x, point->ny = y, point->nz = z;
    point->x = mul_add((realv)ball->radius, x, (realv)ball->centre[0]);
    point->y = mul_add((realv)ball->radius, y, (realv)ball->centre[1]);
    point->z = mul_add((realv)ball->radius, z, (realv)ball->centre[2]);
    point->reach = largest3((realv)ball->centre[0], (realv)ball->centre[1],
                            (realv)ball->centre[2]) + ball->radius;
#if HAS_TEXTURED_BALLS
    realv turn = turn_of(x, z);
    point->at.u = turn < 0 ? turn + 1 : turn;
    point->at.v = R(0.5) + turn_of(y, square_root(mul_add(x, x, z * z))) * 2;
#endif
  }
#endif
  point->sx = point->nx, point->sy = point->ny, point->sz = point->nz;
#if HAS_MESHES
  if (object->kind == SHAPE_MESH) {
    intv triangle = select_int(here, hit->triangle, (intv)object->first);
    triangle_point(triangles, triangle, hit->u, hit->v, point);
    point->sx = point->nx, point->sy = point->ny, point->sz = point->nz;
#if HAS_NORMALS
    if (object->is_smooth) triangle_normal(triangles, triangle, hit->u, hit->v, point);
#endif
#if HAS_INSTANCES
    if (object->instance >= 0) place_point(shapes->instances + object->instance, point);
#endif
    unit_normal(&point->nx, &point->ny, &point->nz);
    unit_normal(&point->sx, &point->sy, &point->sz);
  }
#endif
  /* Both normals face the ray; a shading normal that cannot is replaced. */
  realv along = dot3(point->nx, point->ny, point->nz, ray->dx, ray->dy, ray->dz);
  point->is_front = along < 0;
  realv sign = along > 0 ? (realv)-1 : (realv)1;
  point->nx *= sign, point->ny *= sign, point->nz *= sign;
  realv agreement = dot3(point->sx, point->sy, point->sz, point->nx, point->ny, point->nz);
  sign = agreement < 0 ? (realv)-1 : (realv)1;
  point->sx *= sign, point->sy *= sign, point->sz *= sign;
  maskv seen = dot3(point->sx, point->sy, point->sz, ray->dx, ray->dy, ray->dz) < 0;
  point->sx = seen ? point->sx : point->nx;
  point->sy = seen ? point->sy : point->ny;
  point->sz = seen ? point->sz : point->nz;
}

/* step_off - how far from a surface point a ray must start not to meet the surface again. */
INLINE realv step_off(const pointv *point) {
  return mul_add(point->reach, (realv)(ROUNDING * 8), (realv)R(1e-12));
}

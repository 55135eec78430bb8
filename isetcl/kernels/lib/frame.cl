/* frame.cl - directions in the frame of a surface, z along its normal.
 */
#include "lib/disc.cl"
#include "lib/lanes.cl"

/* Two tangents and the normal. */
typedef struct {
  realv tx, ty, tz, bx, by, bz, nx, ny, nz;
} framev;

typedef struct {
  realv x, y, z;
} vec3v;

/* frame_of - a frame around a unit normal.
 *
 * Source: Duff et al. (2017), "Building an orthonormal basis, revisited", JCGT 6(1).
 */
INLINE void frame_of(realv nx, realv ny, realv nz, framev *frame) {
  realv sign = nz < 0 ? (realv)-1 : (realv)1;
  realv p = -1 / (sign + nz), q = nx * ny * p;
  frame->tx = mul_add(sign * nx, nx * p, (realv)1), frame->ty = sign * q, frame->tz = -sign * nx;
  frame->bx = q, frame->by = mul_add(ny, ny * p, sign), frame->bz = -ny;
  frame->nx = nx, frame->ny = ny, frame->nz = nz;
}

INLINE void to_frame(const framev *f, realv x, realv y, realv z, vec3v *inner) {
  inner->x = dot3(f->tx, f->ty, f->tz, x, y, z);
  inner->y = dot3(f->bx, f->by, f->bz, x, y, z);
  inner->z = dot3(f->nx, f->ny, f->nz, x, y, z);
}

INLINE void to_world(const framev *f, const vec3v *inner, vec3v *world) {
  world->x = mul_add(inner->x, f->tx, mul_add(inner->y, f->bx, inner->z * f->nx));
  world->y = mul_add(inner->x, f->ty, mul_add(inner->y, f->by, inner->z * f->ny));
  world->z = mul_add(inner->x, f->tz, mul_add(inner->y, f->bz, inner->z * f->nz));
}

/* cosine_direction - a direction around z with density cos / pi. */
INLINE void cosine_direction(realv u, realv v, vec3v *d) {
  concentric_disc(u, v, &d->x, &d->y);
  realv rest = 1 - mul_add(d->x, d->x, d->y * d->y);
  d->z = square_root(larger(rest, (realv)0));
}

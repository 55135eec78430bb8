/* paths.cl - the stages of the path pipeline that follow one path a work-item.
 *
 * find_hits, shade and connect take turns, bounce after bounce, over the paths still alive; gather
 * sums what they carried. A path has a slot, and everything is written to its own slot, so that the
 * image does not depend on the order in which paths are listed.
 *
 * A path carries four neighbouring wavelengths of one band. Throughput is relative to the weight it
 * left the eye with.
 */
#include "lib/bounce.cl"
#include "lib/disc.cl"
#include "lib/surface.cl"

#define PI_ R(3.14159265358979323846)

/* find_hits - what every living path meets. Paths of weight 0 meet nothing. */
kernel void find_hits(const int n_alive, global const int *restrict alive, const int n_slots,
                      global const real *restrict origin, global const real *restrict direction,
                      global const real *restrict weight, constant world_t *world,
                      constant flat_t *flats, constant ball_t *balls,
                      global const real8 *restrict nodes, global const real8 *restrict blocks,
                      global const int *restrict triangle_object, global real *restrict distance,
                      global int *restrict object, global int *restrict triangle,
                      global real *restrict hit_uv, const int is_first) {
  const int i = get_global_id(0);
  if (i >= n_alive) return;
  const int slot = is_first ? i : alive[i];
  shape_hit_t hit = {INFINITY, -1, -1, 0, 0};
  if (weight[slot] > 0)
    first_hit(origin[slot], origin[n_slots + slot], origin[2 * n_slots + slot], direction[slot],
              direction[n_slots + slot], direction[2 * n_slots + slot], world, flats, balls, nodes,
              blocks, triangle_object, &hit);
  distance[slot] = hit.distance;
  object[slot] = hit.object;
  triangle[slot] = hit.triangle;
  hit_uv[slot] = hit.u;
  hit_uv[n_slots + slot] = hit.v;
}

/* tangents - two unit vectors at right angles to a unit vector n and to each other.
 *
 * Source: Duff et al. (2017), "Building an orthonormal basis, revisited", JCGT 6(1).
 */
INLINE void tangents(real nx, real ny, real nz, real *t, real *b) {
  const real sign = nz < 0 ? -1 : 1;
  const real p = -1 / (sign + nz), q = nx * ny * p;
  t[0] = 1 + sign * nx * nx * p, t[1] = sign * q, t[2] = -sign * nx;
  b[0] = q, b[1] = sign + ny * ny * p, b[2] = -ny;
}

/* cosine_direction - a direction about n with density cos / pi. */
INLINE void cosine_direction(real nx, real ny, real nz, real u, real v, real *d) {
  real x, y, t[3], b[3];
  concentric_disc(u, v, &x, &y);
  const real rest = 1 - x * x - y * y, z = scalar_root(rest > 0 ? rest : 0);
  tangents(nx, ny, nz, t, b);
  for (int k = 0; k < 3; ++k) d[k] = x * t[k] + y * b[k];
  d[0] += z * nx, d[1] += z * ny, d[2] += z * nz;
}

/* light_density - density, per solid angle at (ox, oy, oz), of choosing the direction that hit. */
INLINE real light_density(constant object_t *object, constant ball_t *balls, real ox, real oy,
                          real oz, real distance, real cosine) {
  if (!(object->density > 0)) return 0;
#if HAS_BALLS
  if (object->kind == SHAPE_BALL) {
    constant ball_t *ball = balls + object->first;
    const real x = ball->centre[0] - ox, y = ball->centre[1] - oy, z = ball->centre[2] - oz;
    const real ratio2 = ball->radius * ball->radius / dot3(x, y, z, x, y, z);
    if (ratio2 >= 1) return object->density / (4 * PI_);
    /* 1 - cos = sin^2 / (1 + cos), which does not cancel for small balls. */
    return object->density / (2 * PI_ * ratio2 / (1 + scalar_root(1 - ratio2)));
  }
#endif
  return cosine > 0 ? object->density * distance * distance / cosine : 0;
}

#if HAS_LIGHTS
/* A place on a light, as seen from a point: direction, distance, and light over density. */
typedef struct {
  real d[3];
  real distance;
  real4 light;   /* radiance / density, or irradiance of a light without size */
  real density;  /* per solid angle; 0 for a light without size */
} light_sample_t;

/* choose_light - the light whose share of the cumulated power holds u. */
INLINE int choose_light(constant light_t *lights, int n_lights, real u) {
  int low = 0, high = n_lights - 1;
  while (low < high) {
    const int middle = (low + high) >> 1;
    if (lights[middle].cumulative > u) high = middle;
    else low = middle + 1;
  }
  return low;
}

/* sample_light - a direction from a point to a place on a light, and what comes from there. */
INLINE void sample_light(const point_t *from, real choice, real u, real v,
                         constant world_t *world, constant light_t *lights,
                         constant object_t *objects, constant flat_t *flats,
                         constant ball_t *balls, constant substance_t *substances,
                         constant picture_t *pictures, global const float *texels,
                         global const real *corners, global const real *uvs,
                         global const real *spectra, int n_columns, int first,
                         light_sample_t *sample) {
  constant light_t *light = lights + choose_light(lights, world->n_lights, choice);
  sample->density = 0;
  sample->light = (real4)(0);
  if (light->kind == LIGHT_DISTANT) {
    for (int k = 0; k < 3; ++k) sample->d[k] = light->place[k];
    sample->distance = INFINITY;
    sample->light = wavelengths4(spectra, n_columns, light->row, first) / light->probability;
    return;
  }
  if (light->kind == LIGHT_POINT) {
    const real x = light->place[0] - from->x, y = light->place[1] - from->y,
               z = light->place[2] - from->z;
    const real d2 = dot3(x, y, z, x, y, z), inverse = 1 / scalar_root(d2);
    sample->d[0] = x * inverse, sample->d[1] = y * inverse, sample->d[2] = z * inverse;
    sample->distance = d2 * inverse;
    sample->light =
        wavelengths4(spectra, n_columns, light->row, first) / (d2 * light->probability);
    return;
  }
  constant object_t *object = objects + light->object;
  constant substance_t *substance = substances + object->substance;
  real qx = 0, qy = 0, qz = 0, nx = 0, ny = 0, nz = 0, tu = 0, tv = 0;
#if HAS_BALLS
  if (object->kind == SHAPE_BALL) {
    constant ball_t *ball = balls + object->first;
    const real x = ball->centre[0] - from->x, y = ball->centre[1] - from->y,
               z = ball->centre[2] - from->z;
    const real d2 = dot3(x, y, z, x, y, z), ratio2 = ball->radius * ball->radius / d2;
    const real away = scalar_root(d2);
    real cosine, sine;
    if (ratio2 >= 1) {
      cosine = 1 - 2 * u;
      sample->density = light->probability / (4 * PI_);
    } else {
      const real versed = ratio2 / (1 + scalar_root(1 - ratio2));
      cosine = 1 - u * versed;
      sample->density = light->probability / (2 * PI_ * versed);
    }
    sine = scalar_root(1 - cosine * cosine > 0 ? 1 - cosine * cosine : 0);
    real t[3], b[3];
    const real ax = x / away, ay = y / away, az = z / away;
    tangents(ax, ay, az, t, b);
    const real phi = 2 * PI_ * v, c = cos(phi) * sine, s = sin(phi) * sine;
    sample->d[0] = cosine * ax + c * t[0] + s * b[0];
    sample->d[1] = cosine * ay + c * t[1] + s * b[1];
    sample->d[2] = cosine * az + c * t[2] + s * b[2];
    const real distance = ball_hit(ball, from->x, from->y, from->z, sample->d[0], sample->d[1],
                                   sample->d[2]);
    sample->distance = distance;
    if (!(distance > 0)) return;
#if HAS_TEXTURED_BALLS
    if (substance->kind != MATERIAL_UNIFORM) {
      const real px = (from->x + distance * sample->d[0] - ball->centre[0]) / ball->radius;
      const real py = (from->y + distance * sample->d[1] - ball->centre[1]) / ball->radius;
      const real pz = (from->z + distance * sample->d[2] - ball->centre[2]) / ball->radius;
      const real turn = turn_of_vector(px, pz);
      tu = turn < 0 ? turn + 1 : turn;
      tv = R(0.5) + turn_of_vector(py, scalar_root(px * px + pz * pz));
    }
#endif
    sample->light = textured4(substance, substance->emission, tu, tv, pictures, texels, spectra,
                             n_columns, first) /
                   sample->density;
    return;
  }
#endif
#if HAS_FLATS
  if (object->kind == SHAPE_FLAT) {
    constant flat_t *flat = flats + object->first;
    tu = u, tv = v;
    if (flat->is_round) {
      concentric_disc(u, v, &tu, &tv);
      tu = R(0.5) + R(0.5) * tu, tv = R(0.5) + R(0.5) * tv;
    }
    qx = flat->corner[0] + tu * flat->edge_u[0] + tv * flat->edge_v[0];
    qy = flat->corner[1] + tu * flat->edge_u[1] + tv * flat->edge_v[1];
    qz = flat->corner[2] + tu * flat->edge_u[2] + tv * flat->edge_v[2];
    nx = flat->normal[0], ny = flat->normal[1], nz = flat->normal[2];
  }
#endif
#if HAS_MESHES
  if (object->kind == SHAPE_MESH) {
    global const real *at = corners + 9 * (size_t)light->triangle;
    const real root = scalar_root(u), a = 1 - root, b = root * (1 - v), c = root * v;
    qx = a * at[0] + b * at[3] + c * at[6];
    qy = a * at[1] + b * at[4] + c * at[7];
    qz = a * at[2] + b * at[5] + c * at[8];
    const real e1x = at[3] - at[0], e1y = at[4] - at[1], e1z = at[5] - at[2];
    const real e2x = at[6] - at[0], e2y = at[7] - at[1], e2z = at[8] - at[2];
    nx = e1y * e2z - e1z * e2y, ny = e1z * e2x - e1x * e2z, nz = e1x * e2y - e1y * e2x;
    const real inverse = 1 / scalar_root(dot3(nx, ny, nz, nx, ny, nz));
    nx *= inverse, ny *= inverse, nz *= inverse;
#if HAS_UV
    global const real *uv = uvs + 6 * (size_t)light->triangle;
    tu = a * uv[0] + b * uv[2] + c * uv[4];
    tv = a * uv[1] + b * uv[3] + c * uv[5];
#endif
  }
#endif
  const real x = qx - from->x, y = qy - from->y, z = qz - from->z;
  const real d2 = dot3(x, y, z, x, y, z), inverse = 1 / scalar_root(d2);
  sample->d[0] = x * inverse, sample->d[1] = y * inverse, sample->d[2] = z * inverse;
  sample->distance = d2 * inverse;
  real cosine = dot3(nx, ny, nz, sample->d[0], sample->d[1], sample->d[2]);
  cosine = cosine < 0 ? -cosine : cosine;
  if (!(cosine > 0) || !(d2 > 0)) return;
  sample->density = object->density * d2 / cosine;
  sample->light = textured4(substance, substance->emission, tu, tv, pictures, texels, spectra,
                           n_columns, first) /
                 sample->density;
}
#endif

/* shade - adds what every living path sees, and sends it on.
 *
 * next, n_next     paths that go on
 * shadowed, n_shadowed   paths whose light must still be found unhidden, with the rays in shadow_*
 */
kernel void shade(
    const int n_alive, global const int *restrict alive, const int n_slots,
    global real *restrict origin, global real *restrict direction,
    global const real *restrict weight, global const real *restrict distance,
    global const int *restrict hit_object, global const int *restrict hit_triangle,
    global const real *restrict hit_uv, global real4 *restrict throughput,
    global real4 *restrict radiance, global real *restrict last_density, constant world_t *world,
    constant object_t *objects, constant flat_t *flats, constant ball_t *balls,
    constant substance_t *substances, constant picture_t *pictures, constant light_t *lights,
    global const float *restrict texels, global const real *restrict corners,
    global const real *restrict normals, global const real *restrict uvs,
    global const real *restrict spectra, const int n_columns, global const int *restrict band_first,
    const int n_bands, const int n_padded, constant tile_t *tile, const uint first_sample,
    const uint block, const int bits, const uint stream, const int bounce, const int max_bounces,
    global int *restrict next, global int *restrict n_next, global int *restrict shadowed,
    global int *restrict n_shadowed, global real *restrict shadow_origin,
    global real *restrict shadow_direction, global real *restrict shadow_most,
    global real4 *restrict shadow_light) {
  /* A counter shared by all work-items is dear on a CPU; a chunk of paths asks it once. */
  const int begin = (int)get_global_id(0) * PATHS_AN_ITEM;
  const int end = begin + PATHS_AN_ITEM < n_alive ? begin + PATHS_AN_ITEM : n_alive;
  int going[PATHS_AN_ITEM], waiting[PATHS_AN_ITEM];
  int n_going = 0, n_waiting = 0;
  for (int i = begin; i < end; ++i) {
    const int slot = bounce == 0 ? i : alive[i];
    if (bounce == 0) radiance[slot] = (real4)(0);
    if (!(weight[slot] > 0)) continue;
    const int pixel = slot % n_padded, rest = slot / n_padded;
    const int band = rest % n_bands, number = rest / n_bands;
    const int first = band_first[band];
    real4 carried = bounce == 0 ? (real4)(1) : throughput[slot];
    const real density = bounce == 0 ? -1 : last_density[slot];
    shape_hit_t hit;
    hit.object = hit_object[slot];
    if (hit.object < 0) {
      if (world->background >= 0)
        radiance[slot] += carried * wavelengths4(spectra, n_columns, world->background, first);
      continue;
    }
    hit.distance = distance[slot];
    hit.triangle = hit_triangle[slot];
    hit.u = hit_uv[slot];
    hit.v = hit_uv[n_slots + slot];
    const real ox = origin[slot], oy = origin[n_slots + slot], oz = origin[2 * n_slots + slot];
    const real dx = direction[slot], dy = direction[n_slots + slot],
               dz = direction[2 * n_slots + slot];
    constant object_t *object = objects + hit.object;
    constant substance_t *substance = substances + object->substance;
    point_t point;
    meet(ox, oy, oz, dx, dy, dz, &hit, objects, flats, balls, substances, corners, normals, uvs,
         &point);
    /* Add what the surface sends out; weigh it against finding the same place as a light. */
    if (substance->emission >= 0) {
      real share = 1;
      if (density > 0) {
        const real cosine = -dot3(point.nx, point.ny, point.nz, dx, dy, dz);
        const real other = light_density(object, balls, ox, oy, oz, hit.distance, cosine);
        share = density / (density + other);
      }
      radiance[slot] += carried * share *
                        textured4(substance, substance->emission, point.u, point.v, pictures, texels,
                                  spectra, n_columns, first);
    }
#if HAS_REFLECTION
    if (substance->reflectance < 0 || bounce >= max_bounces) continue;
    const uint row = (uint)(pixel / tile->columns), column = (uint)(pixel % tile->columns);
    const uint pixel_stream =
        mix_bits(mix_bits((row + tile->y) * tile->image_width + column + tile->x) + stream);
    real chance[8];
    bounce_numbers((uint)band * block + first_sample + (uint)number, bits, pixel_stream, bounce,
                   chance);
    const real4 albedo = textured4(substance, substance->reflectance, point.u, point.v, pictures,
                                   texels, spectra, n_columns, first);
    const real off = step_off(&point);
#if HAS_LIGHTS
    /* Ask one light directly. */
    light_sample_t to_light;
    sample_light(&point, chance[2], chance[4], chance[5], world, lights, objects, flats, balls,
                 substances, pictures, texels, corners, uvs, spectra, n_columns, first, &to_light);
    const real cosine = dot3(point.sx, point.sy, point.sz, to_light.d[0], to_light.d[1], to_light.d[2]);
    const real side = dot3(point.nx, point.ny, point.nz, to_light.d[0], to_light.d[1], to_light.d[2]);
    if (cosine > 0 && side > 0 && to_light.distance > 0) {
      const real scattered = cosine / PI_;
      const real share =
          to_light.density > 0 ? to_light.density / (to_light.density + scattered) : 1;
      const real4 light = carried * albedo * to_light.light * (scattered * share);
      if (light.x > 0 || light.y > 0 || light.z > 0 || light.w > 0) {
        shadow_origin[slot] = point.x + off * point.nx;
        shadow_origin[n_slots + slot] = point.y + off * point.ny;
        shadow_origin[2 * n_slots + slot] = point.z + off * point.nz;
        for (int k = 0; k < 3; ++k) shadow_direction[k * n_slots + slot] = to_light.d[k];
        /* Stop short of the light itself. */
        shadow_most[slot] = to_light.distance * (1 - 64 * ROUNDING) - 2 * off;
        shadow_light[slot] = light;
        waiting[n_waiting++] = slot;
      }
    }
#endif
    /* Go on in a direction drawn from the surface. */
    carried *= albedo;
    const real xy = carried.x > carried.y ? carried.x : carried.y;
    const real zw = carried.z > carried.w ? carried.z : carried.w;
    const real most = xy > zw ? xy : zw;
    if (bounce >= 2) {
      const real survival = most < R(0.95) ? most : R(0.95);
      if (!(chance[3] < survival)) continue;
      carried /= survival;
    }
    if (!(most > 0)) continue;
    real d[3];
    cosine_direction(point.sx, point.sy, point.sz, chance[0], chance[1], d);
    if (!(dot3(point.nx, point.ny, point.nz, d[0], d[1], d[2]) > 0)) continue;
    origin[slot] = point.x + off * point.nx;
    origin[n_slots + slot] = point.y + off * point.ny;
    origin[2 * n_slots + slot] = point.z + off * point.nz;
    for (int k = 0; k < 3; ++k) direction[k * n_slots + slot] = d[k];
    throughput[slot] = carried;
#if HAS_LIGHTS
    last_density[slot] = dot3(point.sx, point.sy, point.sz, d[0], d[1], d[2]) / PI_;
#else
    last_density[slot] = -1;
#endif
    going[n_going++] = slot;
#endif
  }
  if (n_going > 0) {
    const int at = atomic_add(n_next, n_going);
    for (int i = 0; i < n_going; ++i) next[at + i] = going[i];
  }
  if (n_waiting > 0) {
    const int at = atomic_add(n_shadowed, n_waiting);
    for (int i = 0; i < n_waiting; ++i) shadowed[at + i] = waiting[i];
  }
}

/* connect - adds the light that nothing hides. */
kernel void connect(const int n_shadowed, global const int *restrict shadowed, const int n_slots,
                    global const real *restrict origin, global const real *restrict direction,
                    global const real *restrict most, global const real4 *restrict light,
                    global real4 *restrict radiance, constant world_t *world,
                    constant flat_t *flats, constant ball_t *balls,
                    global const real8 *restrict nodes, global const real8 *restrict blocks) {
  const int i = get_global_id(0);
  if (i >= n_shadowed) return;
  const int slot = shadowed[i];
  if (!is_hidden(origin[slot], origin[n_slots + slot], origin[2 * n_slots + slot], direction[slot],
                 direction[n_slots + slot], direction[2 * n_slots + slot], most[slot], world, flats,
                 balls, nodes, blocks))
    radiance[slot] += light[slot];
}

/* gather - the mean over samples of weight times radiance, for every pixel, band and wavelength.
 *
 * film   planes (band, wavelength of the band) of n_padded pixels
 */
kernel void gather(const int n_samples, const int n_bands, const int n_padded,
                   global const real *restrict weight, global const real4 *restrict radiance,
                   global real *restrict film) {
  const int pixel = get_global_id(0), band = get_global_id(1);
  real4 sum = (real4)(0);
  for (int s = 0; s < n_samples; ++s) {
    const size_t slot = ((size_t)s * n_bands + band) * n_padded + pixel;
    sum += weight[slot] * radiance[slot];
  }
  sum /= n_samples;
  global real *at = film + (size_t)band * 4 * n_padded + pixel;
  at[0] = sum.x;
  at[n_padded] = sum.y;
  at[2 * n_padded] = sum.z;
  at[3 * n_padded] = sum.w;
}

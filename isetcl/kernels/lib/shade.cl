/* shade.cl - what paths see where they are, and where they go on.
 *
 * Paths are shaded WIDTH at a time. A path carries four neighbouring wavelengths of one band;
 * its throughput is relative to the weight it left the eye with.
 */
#include "lib/bounce.cl"
#include "lib/paths.cl"
#include "lib/scatter.cl"

/* How fast rays widen behind a surface that scatters them: little enough not to blur what is seen by
 * way of them. */
#define SCATTERED_SPREAD R(0.02)

/* Samples of a launch, for the numbers that decide bounces. */
typedef struct {
  constant tile_t *tile;
  global const int *band_first;
  int n_bands, n_padded, bits;
  uint first_sample, block, stream;
  int first_band, first_pixel; /* of the paths in the planes */
} samples_t;

/* read4 and write4 - four planes of paths. */
INLINE void read4(PLANE const real *planes, int n_slots, const slotsv *at, colourv *value) {
  for (int k = 0; k < 4; ++k) value->w[k] = read_plane(planes + (size_t)k * n_slots, at);
}
INLINE void write4(const colourv *value, PLANE real *planes, int n_slots, const slotsv *at) {
  for (int k = 0; k < 4; ++k) write_plane(value->w[k], planes + (size_t)k * n_slots, at);
}
INLINE void write3(realv x, realv y, realv z, PLANE real *planes, int n_slots, const slotsv *at) {
  write_plane(x, planes, at);
  write_plane(y, planes + n_slots, at);
  write_plane(z, planes + 2 * (size_t)n_slots, at);
}

/* number_paths - pixel stream, sample number and band of every lane. */
INLINE void number_paths(const samples_t *samples, const slotsv *at, uintv *pixel_stream,
                         uintv *sample, bandv *band) {
  intv pixel, number;
  intv rest = divide(at->slot, samples->n_padded, &pixel);
  number = divide(rest, samples->n_bands, &band->number);
  band->number += samples->first_band;
  pixel += samples->first_pixel;
#if ONE_BAND
  band->is_same = 1;
  band->first = (intv)samples->band_first[samples->first_band];
#else
  band->is_same = all_lanes(mask_from_int(band->number == LANE(band->number, 0)));
#pragma unroll
  for (int i = 0; i < WIDTH; ++i)
    LANE(band->first, i) = samples->band_first[LANE(band->number, i)];
#endif
  constant tile_t *tile = samples->tile;
  intv column;
  intv row = divide(pixel, tile->columns, &column);
  intv place = (row + tile->y) * tile->image_width + column + tile->x;
  *pixel_stream = mix_bits(mix_bits(uint_from_int(place)) + samples->stream);
  *sample = uint_from_int(band->number) * samples->block + samples->first_sample +
            uint_from_int(number);
}

/* meet_all - the points that the paths of a group met, with what the surfaces there send out.
 *
 * width      of the rays where they met something, metres
 * added      light found
 * substance  out: the material of every lane, -1 where the path ends
 * passing    out: lanes that go on straight through a surface which adds light
 */
INLINE void meet_all(const shapes_t *shapes, const triangles_t *triangles, const looks_t *looks,
                     const pathv *ray, const shape_hitv *hit, const bandv *band, realv density,
                     realv width, colourv *added, pointv *point, intv *substance, maskv *passing) {
  *substance = (intv)(-1);
  *passing = (maskv)(0);
  intv left = hit->object;
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    global const object_t *object = looks->objects + number;
    pointv one;
    meet(shapes, triangles, object, ray, hit, here, width, &one);
    *substance = select_int(here, (intv)object->substance, *substance);
    if (object->emission >= 0) {
      /* Weigh what is seen against finding the same place as a light. */
      realv share = object->shines_behind ? (realv)1 : (one.is_front ? (realv)1 : (realv)0);
#if HAS_LIGHTS
      realv cosine = -dot3(one.nx, one.ny, one.nz, ray->dx, ray->dy, ray->dz);
      realv other = light_density(shapes, object, ray, hit->distance, cosine);
      share *= density > 0 ? density / (density + other) : (realv)1;
#endif
      colourv sent;
      emitted4(shapes, looks, object, band, &one.at, -ray->dx, -ray->dy, -ray->dz, &sent);
      for (int k = 0; k < 4; ++k) added->w[k] = here ? share * sent.w[k] : added->w[k];
    }
#if HAS_ADDITIVE
    if (object->is_additive) *passing = *passing | here;
#endif
    point->x = here ? one.x : point->x;
    point->y = here ? one.y : point->y;
    point->z = here ? one.z : point->z;
    point->nx = here ? one.nx : point->nx;
    point->ny = here ? one.ny : point->ny;
    point->nz = here ? one.nz : point->nz;
    point->sx = here ? one.sx : point->sx;
    point->sy = here ? one.sy : point->sy;
    point->sz = here ? one.sz : point->sz;
    point->at.u = here ? one.at.u : point->at.u;
    point->at.v = here ? one.at.v : point->at.v;
    point->at.width_u = here ? one.at.width_u : point->at.width_u;
    point->at.width_v = here ? one.at.width_v : point->at.width_v;
    point->reach = here ? one.reach : point->reach;
    point->is_front = here ? one.is_front : point->is_front;
  }
}

/* add_background - light of what surrounds the scene, in lanes that met nothing. */
INLINE void add_background(const shapes_t *shapes, const looks_t *looks, const pathv *ray,
                           const bandv *band, realv density, maskv lost, colourv *added) {
  constant world_t *world = shapes->world;
  if (world->background < 0 || !any_lane(lost)) return;
  colourv sky;
  realv share = 1;
#if HAS_ENVIRONMENT
  realv u, v, cosine;
  environment_place(world, ray->dx, ray->dy, ray->dz, &u, &v, &cosine);
  environment4(world, looks, band, u, v, &sky);
#if HAS_LIGHTS
  if (world->environment_probability > 0) {
    realv other = environment_density(world, looks, u, v, cosine);
    share = density > 0 ? density / (density + other) : (realv)1;
  }
#endif
#else
  spectrum4(looks->spectra, looks->n_columns, world->background, band, &sky);
#endif
  for (int k = 0; k < 4; ++k) added->w[k] = lost ? share * sky.w[k] : added->w[k];
}

#if HAS_REFLECTION
/* What a bounce decides, in every lane. */
typedef struct {
  vec3v d;           /* where paths go on */
  realv density;     /* of that direction; negative without spread, 0 for none */
  colourv weight;
  colourv lit;       /* light of the light that was asked, times everything but the throughput */
} bounced_t;

/* bounce_all - asks a light, and draws where to go on, material by material. */
INLINE void bounce_all(const looks_t *looks, const pathv *ray, const pointv *point,
                       const bandv *band, intv substance, const realv *chance, realv choice,
#if HAS_LIGHTS
                       const light_samplev *light,
#endif
                       bounced_t *bounced) {
  framev frame;
  frame_of(point->sx, point->sy, point->sz, &frame);
  vec3v wo;
  to_frame(&frame, -ray->dx, -ray->dy, -ray->dz, &wo);
  wo.z = larger(wo.z, (realv)R(1e-6));
#if HAS_LIGHTS
  vec3v wl;
  to_frame(&frame, light->dx, light->dy, light->dz, &wl);
  realv side = dot3(point->nx, point->ny, point->nz, light->dx, light->dy, light->dz);
#endif
  bounced->density = (realv)0;
  for (int k = 0; k < 4; ++k) bounced->weight.w[k] = bounced->lit.w[k] = (realv)0;
  bounced->d.x = bounced->d.y = (realv)0, bounced->d.z = (realv)1;
  intv left = substance;
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    closurev closure;
    closure_of(looks, looks->substances + number, band, point, &closure);
#if HAS_LIGHTS
    if (material_scatters_to_lights(&closure)) {
      colourv value;
      material_eval(&closure, &wo, &wl, &value);
      realv pdf = material_pdf(&closure, &wo, &wl);
      maskv possible = here & (light->distance > 0);
      possible = possible & (material_transmits(&closure) ? wl.z * side > 0
                                                           : (wl.z > 0) & (side > 0));
      realv share = light->density > 0 ? light->density / (light->density + pdf) : (realv)1;
      for (int k = 0; k < 4; ++k)
        bounced->lit.w[k] = possible ? value.w[k] * light->light.w[k] * share : bounced->lit.w[k];
    }
#endif
    vec3v inner, d;
    colourv weight;
    realv density =
        material_sample(&closure, &wo, chance[0], chance[1], choice, &inner, &weight);
    to_world(&frame, &inner, &d);
    realv outside = dot3(point->nx, point->ny, point->nz, d.x, d.y, d.z);
    density = inner.z * outside > 0 ? density : (realv)0;
    bounced->d.x = here ? d.x : bounced->d.x;
    bounced->d.y = here ? d.y : bounced->d.y;
    bounced->d.z = here ? d.z : bounced->d.z;
    bounced->density = here ? density : bounced->density;
    for (int k = 0; k < 4; ++k)
      bounced->weight.w[k] = here ? weight.w[k] : bounced->weight.w[k];
  }
}
#endif

/* shade_group - adds what the paths of a group see, and sends them on.
 *
 * going, waiting   out: paths that go on, and those that wait for a light
 */
INLINE void shade_group(const shapes_t *shapes, const triangles_t *triangles,
                        const looks_t *looks, const paths_t *paths, const samples_t *samples,
                        const slotsv *at, int bounce, int max_bounces, int *going, int *waiting) {
  const int n_slots = paths->n_slots;
  shape_hitv hit;
  hit.distance = read_plane(paths->distance, at);
  hit.object = read_int_plane(paths->object, at);
  hit.triangle = read_int_plane(paths->triangle, at);
  hit.u = read_plane(paths->hit_uv, at);
  hit.v = read_plane(paths->hit_uv + n_slots, at);
  realv weight = read_plane(paths->weight, at);
  maskv alive = filled(at) & (weight > 0);
  maskv met = alive & mask_from_int(hit.object >= 0);
  uintv pixel_stream, sample;
  bandv band;
  number_paths(samples, at, &pixel_stream, &sample, &band);
  pathv ray;
  read_rays(paths->origin, paths->direction, n_slots, at, &ray);
  colourv carried, added, seen;
  realv density = -1;
  for (int k = 0; k < 4; ++k) carried.w[k] = (realv)1, added.w[k] = seen.w[k] = (realv)0;
  if (bounce > 0) {
    read4(paths->throughput, n_slots, at, &carried);
    read4(paths->radiance, n_slots, at, &seen);
    density = read_plane(paths->last_density, at);
  }
#if HAS_ADDITIVE
  colourv kept = carried;
#endif
  /* Light of the surroundings and of surfaces. */
  pointv point;
  point.x = point.y = point.z = point.at.u = point.at.v = point.reach = (realv)0;
  point.at.width_u = point.at.width_v = (realv)0;
  point.nx = point.ny = point.sx = point.sy = (realv)0;
  point.nz = point.sz = (realv)1;
  point.is_front = met;
  intv substance;
  maskv passing;
  realv width = 0;
#if HAS_LEVELS
  /* As wide as a pixel on mirrors and before the first bounce, wider after others. */
  realv spread = density < 0 ? (realv)samples->tile->pixel_rad : (realv)SCATTERED_SPREAD;
  width = spread * (met ? hit.distance : (realv)0);
  if (bounce > 0) width += read_plane(paths->width, at);
  write_plane(width, paths->width, at);
#endif
  add_background(shapes, looks, &ray, &band, density, alive & !met, &added);
  hit.object = select_int(met, hit.object, (intv)(-1));
  meet_all(shapes, triangles, looks, &ray, &hit, &band, density, width, &added, &point, &substance,
           &passing);
  for (int k = 0; k < 4; ++k) seen.w[k] = mul_add(carried.w[k], added.w[k], seen.w[k]);
  write4(&seen, paths->radiance, n_slots, at);
  intv go = 0, wait = 0;
#if HAS_ADDITIVE
  intv scattered = bounce > 0 ? read_int_plane(paths->bounces, at) : (intv)0;
  if (any_lane(passing)) {
    go = select_int(passing & met, (intv)1, go);
    write_plane((passing & met) ? hit.distance : (realv)0, paths->passed, at);
  } else {
    write_plane((realv)0, paths->passed, at);
  }
  met = met & !passing & mask_from_int(scattered < max_bounces);
#else
  if (bounce >= max_bounces) met = (maskv)(0);
#endif
#if HAS_REFLECTION
  substance = select_int(met & mask_from_int(substance >= 0), substance, (intv)(-1));
  met = mask_from_int(substance >= 0);
  if (any_lane(met)) {
    realv chance[8];
    bounce_numbers(sample, samples->bits, pixel_stream, bounce, 0, chance);
#if HAS_LIGHTS || HAS_CHOICES
    bounce_numbers(sample, samples->bits, pixel_stream, bounce, 1, chance + 4);
#else
    chance[6] = chance[7] = (realv)0;
#endif
    substance = resolve(looks, substance, &point, chance[7]);
    realv off = step_off(&point);
    bounced_t bounced;
#if HAS_LIGHTS
    light_samplev light;
    sample_lights(shapes, triangles, looks, &point, &band, met, chance[2], chance[4], chance[5],
                  &light);
    bounce_all(looks, &ray, &point, &band, substance, chance, chance[6], &light, &bounced);
    /* Wait for what may be hidden. */
    colourv lit;
    for (int k = 0; k < 4; ++k) lit.w[k] = carried.w[k] * bounced.lit.w[k];
    maskv waits = met & (largest4(&lit) > 0);
    wait = select_int(waits, (intv)1, (intv)0);
    realv side = dot3(point.nx, point.ny, point.nz, light.dx, light.dy, light.dz);
    realv out = side > 0 ? off : -off;
    write3(mul_add(out, point.nx, point.x), mul_add(out, point.ny, point.y),
           mul_add(out, point.nz, point.z), paths->shadow_origin, n_slots, at);
    /* Aim anew from there, or a light seen at a grazing angle would lie behind itself. */
    maskv is_near = light.distance < INFINITY;
    realv reach = is_near ? light.distance : (realv)0;
    realv tx = mul_add(reach, light.dx, -out * point.nx);
    realv ty = mul_add(reach, light.dy, -out * point.ny);
    realv tz = mul_add(reach, light.dz, -out * point.nz);
    reach = normalised(&tx, &ty, &tz);
    write3(is_near ? tx : light.dx, is_near ? ty : light.dy, is_near ? tz : light.dz,
           paths->shadow_direction, n_slots, at);
    /* Stop short of the light itself. */
    realv most_near = mul_add(reach, (realv)(1 - 64 * ROUNDING), -2 * off);
    write_plane(is_near ? most_near : (realv)INFINITY, paths->shadow_most, at);
    write4(&lit, paths->shadow_light, n_slots, at);
#else
    bounce_all(looks, &ray, &point, &band, substance, chance, chance[6], &bounced);
#endif
    /* Go on, or end by chance where little is carried. */
    for (int k = 0; k < 4; ++k) carried.w[k] *= bounced.weight.w[k];
    realv most = largest4(&carried);
    maskv on = met & (bounced.density != 0) & (most > 0);
#if HAS_ADDITIVE
    maskv may_end = mask_from_int(scattered >= 2);
#else
    maskv may_end = (maskv)(bounce >= 2 ? -1 : 0);
#endif
    if (any_lane(may_end)) {
      realv survival = may_end ? smaller(most, (realv)R(0.95)) : (realv)1;
      on = on & (chance[3] < survival);
      realv scale = 1 / (survival > 0 ? survival : (realv)1);
      for (int k = 0; k < 4; ++k) carried.w[k] *= scale;
    }
    realv side_on = dot3(point.nx, point.ny, point.nz, bounced.d.x, bounced.d.y, bounced.d.z);
    realv out_on = side_on > 0 ? off : -off;
#if HAS_ADDITIVE
    write3(passing ? ray.ox : mul_add(out_on, point.nx, point.x),
           passing ? ray.oy : mul_add(out_on, point.ny, point.y),
           passing ? ray.oz : mul_add(out_on, point.nz, point.z), paths->origin, n_slots, at);
    write3(passing ? ray.dx : bounced.d.x, passing ? ray.dy : bounced.d.y,
           passing ? ray.dz : bounced.d.z, paths->direction, n_slots, at);
    for (int k = 0; k < 4; ++k) kept.w[k] = passing ? kept.w[k] : carried.w[k];
    density = passing ? density : HAS_LIGHTS ? bounced.density : (realv)-1;
#else
    write3(mul_add(out_on, point.nx, point.x), mul_add(out_on, point.ny, point.y),
           mul_add(out_on, point.nz, point.z), paths->origin, n_slots, at);
    write3(bounced.d.x, bounced.d.y, bounced.d.z, paths->direction, n_slots, at);
    write4(&carried, paths->throughput, n_slots, at);
    write_plane(HAS_LIGHTS ? bounced.density : (realv)-1, paths->last_density, at);
#endif
    go = select_int(on, (intv)1, go);
  }
#endif
#if HAS_ADDITIVE
  /* Paths that only pass keep what they carry. */
  write4(&kept, paths->throughput, n_slots, at);
  write_plane(density, paths->last_density, at);
  write_int_plane(scattered + select_int(met, (intv)1, (intv)0), paths->bounces, at);
#endif
#if WIDTH == 1
  *going = go, *waiting = wait;
#else
  *(intv_mem *)going = go;
  *(intv_mem *)waiting = wait;
#endif
}

/* lights.cl - choosing lights, places on them, and the densities of both.
 */
#include "lib/surface.cl"
#include "lib/texture.cl"

#define PI_ R(3.14159265358979323846)

/* Everything that says how surfaces and lights look. */
typedef struct {
  global const object_t *objects;
  global const substance_t *substances;
  global const texture_t *textures;
  global const light_t *lights;
  global const float *texels;
  global const real *spectra;
  int n_columns;
} looks_t;

/* emitted4 - the radiance of an object at (u, v) into unit directions. */
INLINE void emitted4(const shapes_t *shapes, const looks_t *looks, global const object_t *object,
                     const bandv *band, const placev *at, realv dx, realv dy, realv dz,
                     colourv *value) {
#if HAS_LIGHT_FIELDS
  if (object->emission_texture >= 0 &&
      looks->textures[object->emission_texture].kind == TEXTURE_LIGHT_FIELD) {
    global const texture_t *texture = looks->textures + object->emission_texture;
    constant flat_t *flat = shapes->flats + object->first;
    realv ahead = dot3((realv)flat->normal[0], (realv)flat->normal[1], (realv)flat->normal[2], dx,
                       dy, dz);
    realv x = dot3((realv)flat->axis_u[0], (realv)flat->axis_u[1], (realv)flat->axis_u[2], dx, dy,
                   dz);
    realv y = dot3((realv)flat->axis_v[0], (realv)flat->axis_v[1], (realv)flat->axis_v[2], dx, dy,
                   dz);
    /* Behind the surface there is no light. */
    realv inverse = ahead > 0 ? 1 / ahead : (realv)R(1e30);
    light_field4(texture, looks->texels, looks->spectra, looks->n_columns, object->emission, band,
                 at->u, at->v, x * inverse * texture->periods_u, y * inverse * texture->periods_v, value);
    return;
  }
#endif
  textured4(looks->textures, object->emission_texture, looks->texels, looks->spectra,
            looks->n_columns, object->emission, band, at, value);
}

/* opacity_of - the share of an object that is there. */
INLINE realv opacity_of(const looks_t *looks, global const object_t *object, const placev *at) {
  if (object->opacity_texture < 0) return (realv)object->opacity;
  return grey_weight(looks->textures + object->opacity_texture, looks->texels, at);
}

#if HAS_BALLS
/* ball_slack - how near a point (x, y, z) must be to a ball to be taken to lie on it. */
INLINE realv ball_slack(constant ball_t *ball, realv x, realv y, realv z) {
  realv most = larger(magnitude(x), larger(magnitude(y), magnitude(z)));
  return mul_add(most + 2 * ball->radius, (realv)(32 * ROUNDING), (realv)R(4e-12));
}

/* ball_cone - 1 - cos of the cone under which a ball is seen from a distance; 2, all directions,
 * from inside and from its surface, where rounding must not decide.
 *
 * 1 - cos = sin^2 / (1 + cos), which does not cancel for small balls.
 */
INLINE realv ball_cone(constant ball_t *ball, realv away, realv slack) {
  maskv inside = away < ball->radius + slack;
  realv ratio = inside ? (realv)1 : ball->radius / away, ratio2 = ratio * ratio;
  return inside ? (realv)2 : ratio2 / (1 + square_root(1 - ratio2));
}
#endif

#if HAS_LIGHTS
/* light_density - density, per solid angle at rays' origins, of choosing the place they hit. */
INLINE realv light_density(const shapes_t *shapes, global const object_t *object,
                           const pathv *ray, realv distance, realv cosine) {
  if (!(object->density > 0)) return (realv)0;
#if HAS_BALLS
  if (object->kind == SHAPE_BALL) {
    constant ball_t *ball = shapes->balls + object->first;
    realv x = ball->centre[0] - ray->ox, y = ball->centre[1] - ray->oy,
          z = ball->centre[2] - ray->oz;
    realv cone = ball_cone(ball, square_root(dot3(x, y, z, x, y, z)),
                           ball_slack(ball, ray->ox, ray->oy, ray->oz));
    return object->density / (2 * PI_ * cone);
  }
#endif
  return cosine > 0 ? object->density * distance * distance / cosine : (realv)0;
}

/* Places on lights, as seen from points. */
typedef struct {
  realv dx, dy, dz;
  realv distance;  /* 0 or less where there is nothing to be seen */
  realv density;   /* per solid angle; 0 for lights without size */
  colourv light;   /* radiance / density, or irradiance of a light without size */
} light_samplev;

/* choose_lights - the lights whose share of the cumulated power holds u. */
INLINE intv choose_lights(const looks_t *looks, int n_lights, realv u) {
  if (n_lights == 1) return (intv)0;
  intv chosen;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) {
    int low = 0, high = n_lights - 1;
    while (low < high) {
      const int middle = (low + high) >> 1;
      if (looks->lights[middle].cumulative > LANE(u, i)) high = middle;
      else low = middle + 1;
    }
    LANE(chosen, i) = low;
  }
  return chosen;
}

#if HAS_BALLS
/* sample_ball - a direction in the cone under which a ball is seen. */
INLINE void sample_ball(const shapes_t *shapes, const looks_t *looks,
                        global const light_t *light, global const object_t *object,
                        const pointv *from, const bandv *band, realv u, realv v,
                        light_samplev *sample) {
  constant ball_t *ball = shapes->balls + object->first;
  realv x = ball->centre[0] - from->x, y = ball->centre[1] - from->y, z = ball->centre[2] - from->z;
  realv away = normalised(&x, &y, &z);
  realv slack = ball_slack(ball, from->x, from->y, from->z);
  realv cone = ball_cone(ball, away, slack);
  realv versed = u * cone;
  realv cosine = 1 - versed;
  realv sine = square_root(larger(versed * (2 - versed), (realv)0));
  realv s, c;
  sine_cosine_turn(v, &s, &c);
  framev frame;
  frame_of(x, y, z, &frame);
  vec3v inner = {c * sine, s * sine, cosine}, d;
  to_world(&frame, &inner, &d);
  sample->dx = d.x, sample->dy = d.y, sample->dz = d.z;
  sample->density = light->probability / (2 * PI_ * cone);
  pathv ray = {from->x, from->y, from->z, d.x, d.y, d.z};
  /* From its own surface a ball is seen across, not where the point lies. */
  maskv on_it = magnitude(away - ball->radius) < slack;
  realv distance;
  maskv met = ball_hit(ball, &ray, on_it ? (realv)INFINITY : (realv)0, &distance);
  met = met & (distance > (on_it ? slack : (realv)0));
  sample->distance = met ? distance : (realv)0;
  placev on = {(realv)0, (realv)0, (realv)0, (realv)0};
#if HAS_TEXTURED_BALLS
  if (object->emission_texture >= 0 || object->opacity_texture >= 0) {
    realv px = mul_add(distance, d.x, from->x - ball->centre[0]);
    realv py = mul_add(distance, d.y, from->y - ball->centre[1]);
    realv pz = mul_add(distance, d.z, from->z - ball->centre[2]);
    realv turn = turn_of(px, pz);
    on.u = turn < 0 ? turn + 1 : turn;
    on.v = mul_add((realv)2, turn_of(py, square_root(mul_add(px, px, pz * pz))), (realv)R(0.5));
  }
#endif
  emitted4(shapes, looks, object, band, &on, -d.x, -d.y, -d.z, &sample->light);
  /* The nearer of two hits is seen from outside. */
  realv outside = distance < away * inner.z ? (realv)1 : (realv)0;
  realv scale = (object->shines_behind ? (realv)1 : outside) / sample->density;
#if HAS_CUTOUTS
  scale *= opacity_of(looks, object, &on);
#endif
  scale = met ? scale : (realv)0;
  for (int k = 0; k < 4; ++k) sample->light.w[k] *= scale;
}
#endif

/* sample_area - a place drawn evenly from a flat shape or a triangle. */
INLINE void sample_area(const shapes_t *shapes, const triangles_t *triangles,
                        const looks_t *looks, global const light_t *light,
                        global const object_t *object, const pointv *from, const bandv *band,
                        realv u, realv v, light_samplev *sample) {
  pointv on;
  on.at.u = u, on.at.v = v, on.at.width_u = on.at.width_v = (realv)0;
#if HAS_FLATS
  if (object->kind == SHAPE_FLAT) {
    constant flat_t *flat = shapes->flats + object->first;
    if (flat->is_round) {
      realv a, b;
      concentric_disc(u, v, &a, &b);
      on.at.u = mul_add((realv)R(0.5), a, (realv)R(0.5));
      on.at.v = mul_add((realv)R(0.5), b, (realv)R(0.5));
    }
    on.x = mul_add(on.at.u, (realv)flat->edge_u[0],
                   mul_add(on.at.v, (realv)flat->edge_v[0], (realv)flat->corner[0]));
    on.y = mul_add(on.at.u, (realv)flat->edge_u[1],
                   mul_add(on.at.v, (realv)flat->edge_v[1], (realv)flat->corner[1]));
    on.z = mul_add(on.at.u, (realv)flat->edge_u[2],
                   mul_add(on.at.v, (realv)flat->edge_v[2], (realv)flat->corner[2]));
    on.nx = flat->normal[0], on.ny = flat->normal[1], on.nz = flat->normal[2];
  }
#endif
#if HAS_MESHES
  if (object->kind == SHAPE_MESH) {
    realv root = square_root(u);
    triangle_point(triangles, (intv)light->triangle, root * (1 - v), root * v, &on);
    unit_normal(&on.nx, &on.ny, &on.nz);
  }
#endif
  realv x = on.x - from->x, y = on.y - from->y, z = on.z - from->z;
  realv d2 = dot3(x, y, z, x, y, z);
  realv inverse = 1 / square_root(larger(d2, (realv)R(1e-30)));
  x *= inverse, y *= inverse, z *= inverse;
  realv cosine = -dot3(on.nx, on.ny, on.nz, x, y, z);
  maskv lit = cosine > 0;
  if (object->shines_behind) {
    cosine = magnitude(cosine);
    lit = cosine > 0;
  }
  sample->dx = x, sample->dy = y, sample->dz = z;
  sample->distance = lit ? d2 * inverse : (realv)0;
  sample->density = object->density * d2 / (lit ? cosine : (realv)1);
  emitted4(shapes, looks, object, band, &on.at, -x, -y, -z, &sample->light);
  realv scale = lit ? 1 / sample->density : (realv)0;
#if HAS_CUTOUTS
  scale *= opacity_of(looks, object, &on.at);
#endif
  for (int k = 0; k < 4; ++k) sample->light.w[k] *= scale;
}

/* sample_small - a light without size: a point, a spot or a distant one. */
INLINE void sample_small(const looks_t *looks, global const light_t *light, const pointv *from,
                         const bandv *band, light_samplev *sample) {
  sample->density = (realv)0;
  spectrum4(looks->spectra, looks->n_columns, light->row, band, &sample->light);
  realv scale = 1 / light->probability;
  if (light->kind == LIGHT_DISTANT) {
    sample->dx = light->place[0], sample->dy = light->place[1], sample->dz = light->place[2];
    sample->distance = (realv)INFINITY;
  } else {
    realv x = light->place[0] - from->x, y = light->place[1] - from->y,
          z = light->place[2] - from->z;
    sample->distance = normalised(&x, &y, &z);
    sample->dx = x, sample->dy = y, sample->dz = z;
    scale = scale / (sample->distance * sample->distance);
#if HAS_SPOTS
    if (light->kind == LIGHT_SPOT) {
      /* 1 - cos = |a - b|^2 / 2 of unit vectors does not cancel in narrow cones. */
      realv ax = x + light->axis[0], ay = y + light->axis[1], az = z + light->axis[2];
      realv versed = R(0.5) * dot3(ax, ay, az, ax, ay, az);
      realv t = (light->versed_outer - versed) * light->inverse_penumbra;
      t = smaller(larger(t, (realv)0), (realv)1);
      scale *= t * t * (3 - 2 * t);
    }
#endif
  }
  for (int k = 0; k < 4; ++k) sample->light.w[k] *= scale;
}
#endif

#if HAS_ENVIRONMENT
/* environment_place - coordinates of world directions in the image around the scene. */
INLINE void environment_place(constant world_t *world, realv dx, realv dy, realv dz, realv *u,
                              realv *v, realv *cosine) {
  constant real *m = world->rotation;
  realv x = dot3((realv)m[0], (realv)m[3], (realv)m[6], dx, dy, dz);
  realv y = dot3((realv)m[1], (realv)m[4], (realv)m[7], dx, dy, dz);
  realv z = dot3((realv)m[2], (realv)m[5], (realv)m[8], dx, dy, dz);
  realv turn = turn_of(x, z);
  *u = turn < 0 ? turn + 1 : turn;
  *cosine = square_root(mul_add(x, x, z * z));
  *v = mul_add((realv)2, turn_of(y, *cosine), (realv)R(0.5));
}

INLINE void environment4(constant world_t *world, const looks_t *looks, const bandv *band, realv u,
                         realv v, colourv *value) {
  const placev at = {u, v, (realv)0, (realv)0};
  textured4(looks->textures, world->environment, looks->texels, looks->spectra, looks->n_columns,
            world->background, band, &at, value);
}

#if HAS_LIGHTS
/* density_of_share - density per solid angle in a texel that is drawn by its share. */
INLINE realv density_of_share(constant world_t *world, realv share, realv cosine) {
  const real texels = (real)world->environment_columns * world->environment_rows;
  const real scale = world->environment_probability * texels / (2 * PI_ * PI_);
  return share * scale / larger(cosine, (realv)R(1e-9));
}

/* environment_density - density per solid angle with which a direction is drawn.
 *
 * Every texel is drawn by its share of the light; the shares lie in a table (rows, columns).
 */
INLINE realv environment_density(constant world_t *world, const looks_t *looks, realv u, realv v,
                                 realv cosine) {
  const int columns = world->environment_columns, rows = world->environment_rows;
  global const float *shares = looks->texels + world->environment_shares;
  intv column = int_from_real(u * columns), row = int_from_real((1 - v) * rows);
  column = column < 0 ? (intv)0 : column > columns - 1 ? (intv)(columns - 1) : column;
  row = row < 0 ? (intv)0 : row > rows - 1 ? (intv)(rows - 1) : row;
  realv share;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i)
    LANE(share, i) = shares[LANE(row, i) * columns + LANE(column, i)];
  return density_of_share(world, share, cosine);
}

/* sample_environment - a direction drawn by the light that comes from it. */
INLINE void sample_environment(constant world_t *world, const looks_t *looks, const bandv *band,
                               realv a, realv b, light_samplev *sample) {
  const int columns = world->environment_columns, rows = world->environment_rows;
  global const float *of_rows = looks->texels + world->environment_rows_sum;
  global const float *of_columns = looks->texels + world->environment_columns_sum;
  global const float *shares = looks->texels + world->environment_shares;
  realv u, v, share;
  for (int i = 0; i < WIDTH; ++i) {
    int low = 0, high = rows - 1;
    while (low < high) {
      const int middle = (low + high) >> 1;
      if (of_rows[middle] > LANE(b, i)) high = middle;
      else low = middle + 1;
    }
    const int row = low;
    const real before = row > 0 ? of_rows[row - 1] : 0;
    const real in_row = (LANE(b, i) - before) / (of_rows[row] - before);
    global const float *sums = of_columns + (size_t)row * columns;
    low = 0, high = columns - 1;
    while (low < high) {
      const int middle = (low + high) >> 1;
      if (sums[middle] > LANE(a, i)) high = middle;
      else low = middle + 1;
    }
    const real left = low > 0 ? sums[low - 1] : 0;
    LANE(u, i) = (low + (LANE(a, i) - left) / (sums[low] - left)) / columns;
    LANE(v, i) = 1 - (row + in_row) / rows;
    /* Looked up by place, a texel at its border could be taken for its neighbour. */
    LANE(share, i) = shares[(size_t)row * columns + low];
  }
  u = smaller(larger(u, (realv)0), (realv)1);
  v = smaller(larger(v, (realv)0), (realv)1);
  realv sine, cosine, s, c;
  sine_cosine_quarter((v - R(0.5)) * (PI_ / 2), &s, &c);
  sine = 2 * s * c, cosine = mul_add(-2 * s, s, (realv)1);
  sine_cosine_turn(u, &s, &c);
  realv x = cosine * s, y = sine, z = cosine * c;
  constant real *m = world->rotation;
  sample->dx = dot3((realv)m[0], (realv)m[1], (realv)m[2], x, y, z);
  sample->dy = dot3((realv)m[3], (realv)m[4], (realv)m[5], x, y, z);
  sample->dz = dot3((realv)m[6], (realv)m[7], (realv)m[8], x, y, z);
  sample->distance = (realv)INFINITY;
  sample->density = density_of_share(world, share, cosine);
  environment4(world, looks, band, u, v, &sample->light);
  realv scale = sample->density > 0 ? 1 / sample->density : (realv)0;
  for (int k = 0; k < 4; ++k) sample->light.w[k] *= scale;
}
#endif
#endif

#if HAS_LIGHTS
/* sample_lights - in every lane a place on one light, chosen by power. */
INLINE void sample_lights(const shapes_t *shapes, const triangles_t *triangles,
                          const looks_t *looks, const pointv *from, const bandv *band,
                          maskv wanted, realv choice, realv u, realv v, light_samplev *sample) {
  sample->distance = sample->density = (realv)0;
  sample->dx = sample->dy = (realv)0, sample->dz = (realv)1;
  for (int k = 0; k < 4; ++k) sample->light.w[k] = (realv)0;
  if (shapes->world->n_lights == 0) return;
  intv left = select_int(wanted, choose_lights(looks, shapes->world->n_lights, choice), (intv)-1);
  for (;;) {
    maskv here;
    const int number = next_number(&left, &here);
    if (number < 0) break;
    global const light_t *light = looks->lights + number;
    light_samplev one;
    if (light->kind == LIGHT_OBJECT) {
      global const object_t *object = looks->objects + light->object;
#if HAS_BALLS
      if (object->kind == SHAPE_BALL)
        sample_ball(shapes, looks, light, object, from, band, u, v, &one);
      else
#endif
        sample_area(shapes, triangles, looks, light, object, from, band, u, v, &one);
#if HAS_ENVIRONMENT
    } else if (light->kind == LIGHT_ENVIRONMENT) {
      sample_environment(shapes->world, looks, band, u, v, &one);
#endif
    } else {
      sample_small(looks, light, from, band, &one);
    }
    sample->dx = here ? one.dx : sample->dx;
    sample->dy = here ? one.dy : sample->dy;
    sample->dz = here ? one.dz : sample->dz;
    sample->distance = here ? one.distance : sample->distance;
    sample->density = here ? one.density : sample->density;
    for (int k = 0; k < 4; ++k) sample->light.w[k] = here ? one.light.w[k] : sample->light.w[k];
  }
}
#endif

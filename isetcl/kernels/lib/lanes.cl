/* lanes.cl - numbers of lanes: reading and writing at places of their own, and taking turns.
 */
#include "lib/real.cl"

/* PLANE - where the state of paths lies: in device memory, or in that of a work-group. */
#if PATHS_ARE_LOCAL
#define PLANE local
#else
#define PLANE global
#endif

/* LANE - one lane of a vector; a vector of one lane is a number. */
#if WIDTH == 1
#define LANE(x, i) (x)
#else
#define LANE(x, i) (x)[i]
#endif

/* A vector by lanes, for loops that follow one lane at a time. */
typedef union {
  realv all;
  real lane[WIDTH];
} lanesv_t;

/* Four neighbouring wavelengths of a path in every lane. */
typedef struct {
  realv w[4];
} colourv;

/* slotsv - where the paths of a group lie in the planes of paths.
 *
 * is_row   whether they are neighbours, so that a plane is read with one load
 */
typedef struct {
  intv slot;
  int count;
  int is_row;
} slotsv;

/* any_lane - whether a condition holds in some lane. */
INLINE int any_lane(maskv condition) { return !all_lanes(!condition); }

/* largest_lane - the largest number of all lanes. */
INLINE int largest_lane(intv x) {
#ifdef HAS_REDUCTIONS
  return __builtin_reduce_max(x);
#else
  int most = LANE(x, 0);
#pragma unroll
  for (int i = 1; i < WIDTH; ++i) most = LANE(x, i) > most ? LANE(x, i) : most;
  return most;
#endif
}

/* next_number - the largest number left, and the lanes that have it; they are then done (-1).
 *
 * Lanes that share a shape, a material or a light are served together, whose record is read once.
 */
INLINE int next_number(intv *left, maskv *here) {
  const int number = largest_lane(*left);
  *here = mask_from_int(*left == number);
  *left = *left == number ? (intv)(-1) : *left;
  return number;
}

INLINE intv select_int(maskv condition, intv yes, intv no) {
  return int_from_mask(condition) ? yes : no;
}

/* read_plane - values of a plane at the slots of a group. */
INLINE realv read_plane(PLANE const real *plane, const slotsv *at) {
  if (at->is_row) return *(PLANE const realv_mem *)(plane + LANE(at->slot, 0));
  realv value;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) LANE(value, i) = plane[LANE(at->slot, i)];
  return value;
}
INLINE intv read_int_plane(PLANE const int *plane, const slotsv *at) {
  if (at->is_row) return *(PLANE const intv_mem *)(plane + LANE(at->slot, 0));
  intv value;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) LANE(value, i) = plane[LANE(at->slot, i)];
  return value;
}

/* write_plane - the same, the other way. Slots of paths that have ended may be written, too. */
INLINE void write_plane(realv value, PLANE real *plane, const slotsv *at) {
  if (at->is_row)
    *(PLANE realv_mem *)(plane + LANE(at->slot, 0)) = value;
  else
    for (int i = 0; i < at->count; ++i) plane[LANE(at->slot, i)] = LANE(value, i);
}
INLINE void write_int_plane(intv value, PLANE int *plane, const slotsv *at) {
  if (at->is_row)
    *(PLANE intv_mem *)(plane + LANE(at->slot, 0)) = value;
  else
    for (int i = 0; i < at->count; ++i) plane[LANE(at->slot, i)] = LANE(value, i);
}

/* slots_of - the slots of `count` paths of a list from number `first`; all paths where is_first. */
INLINE void slots_of(PLANE const int *alive, int first, int n_alive, int is_first, slotsv *at) {
  at->count = n_alive - first < WIDTH ? n_alive - first : WIDTH;
  if (is_first && at->count == WIDTH) {
    at->slot = first + int_from_uint(lane_numbers());
    at->is_row = 1;
    return;
  }
  int is_row = at->count == WIDTH;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) {
    const int number = i < at->count ? first + i : first;
    LANE(at->slot, i) = is_first ? number : alive[number];
  }
#pragma unroll
  for (int i = 1; i < WIDTH; ++i) is_row &= LANE(at->slot, i) == LANE(at->slot, 0) + i;
  at->is_row = is_row;
}

/* filled - the lanes that hold a path. */
INLINE maskv filled(const slotsv *at) {
  return mask_from_int(int_from_uint(lane_numbers()) < at->count);
}

INLINE realv dot3(realv ax, realv ay, realv az, realv bx, realv by, realv bz) {
  return mul_add(ax, bx, mul_add(ay, by, az * bz));
}

INLINE real magnitude1(real x) { return x < 0 ? -x : x; }

INLINE realv largest4(const colourv *c) {
  return larger(larger(c->w[0], c->w[1]), larger(c->w[2], c->w[3]));
}

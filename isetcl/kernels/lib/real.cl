/* real.cl - the arithmetic that all kernels are written in.
 *
 * One source serves every device. `realv` is WIDTH lanes of `real`; every lane is one ray, pixel or
 * sample. On a GPU WIDTH is 1 and a lane is a work-item; on a CPU several hardware vectors side by
 * side hide the latency of square roots and divisions, which a compiler does not arrange by itself.
 *
 * No library function is called on a hot path: on CPUs they are real calls that stop vectorisation.
 * Products and sums are contracted to fused multiply-adds by the compiler; the start-up self-test
 * (selftest.cl) refuses a device that does not do so. Fast-math options are never used.
 *
 * From the host: DOUBLE_PRECISION (0 or 1), WIDTH (1, 2, 4, ... 64; > 1 needs clang's vectors),
 * CPU_BUILTINS (1 where __builtin_sqrt compiles to an instruction).
 */
#if DOUBLE_PRECISION
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
typedef double real;
typedef double4 real4;
typedef double8 real8;
typedef long real_bits;
typedef long8 real_bits8;
#define R(x) x
#else
typedef float real;
typedef float4 real4;
typedef float8 real8;
typedef int real_bits;
typedef int8 real_bits8;
#define R(x) x##f
#endif

#define INLINE __attribute__((always_inline)) static inline

/* SHARED - for long functions that are called in several places: with a copy in each place kernels
 * take many times as long to build, and a call costs little beside such a function. A GPU inlines
 * everything anyway.
 */
#if CPU_BUILTINS
#define SHARED __attribute__((noinline, unused)) static
#else
#define SHARED INLINE
#endif

#if WIDTH == 1
typedef real realv;      /* lanes of reals */
typedef real_bits maskv; /* lanes of truth values, as comparisons of realv give them */
typedef int intv;        /* lanes of 32-bit integers */
typedef uint uintv;
typedef float floatv; /* lanes of floats, whatever the precision of real */
#else
typedef real realv __attribute__((ext_vector_type(WIDTH)));
typedef real_bits maskv __attribute__((ext_vector_type(WIDTH)));
typedef int intv __attribute__((ext_vector_type(WIDTH)));
typedef uint uintv __attribute__((ext_vector_type(WIDTH)));
typedef float floatv __attribute__((ext_vector_type(WIDTH)));
#endif

/* The same, as they lie in memory: aligned to one element only. */
#if WIDTH == 1
typedef real realv_mem;
typedef int intv_mem;
#else
typedef real realv_mem __attribute__((ext_vector_type(WIDTH), aligned(sizeof(real))));
typedef int intv_mem __attribute__((ext_vector_type(WIDTH), aligned(4)));
#endif

/* mul_add - a b + c with one rounding. */
#if CPU_BUILTINS
#define mul_add(a, b, c) ((a) * (b) + (c))
#else
#define mul_add(a, b, c) fma((realv)(a), (realv)(b), (realv)(c))
#endif

/* Conversions between lanes. real_from_uint keeps 31 bits. */
#if WIDTH == 1
#define real_from_int(x) ((realv)(x))
#define int_from_real(x) ((intv)(x))
#define int_from_mask(x) ((intv)(x))
#define mask_from_int(x) ((maskv)(x))
#define int_from_uint(x) as_int(x)
#define uint_from_int(x) as_uint(x)
#define real_from_float(x) ((realv)(x))
#else
#define real_from_int(x) __builtin_convertvector((x), realv)
#define int_from_real(x) __builtin_convertvector((x), intv)
#define int_from_mask(x) __builtin_convertvector((x), intv)
#define mask_from_int(x) __builtin_convertvector((x), maskv)
#define int_from_uint(x) __builtin_astype((x), intv)
#define uint_from_int(x) __builtin_astype((x), uintv)
#define real_from_float(x) __builtin_convertvector((x), realv)
#endif

/* square_root - correctly rounded lane by lane; eight at a time become one instruction. */
#if !CPU_BUILTINS
INLINE realv square_root(realv x) { return sqrt(x); }
#else
#if DOUBLE_PRECISION
#define SQRT1 __builtin_sqrt
#else
#define SQRT1 __builtin_sqrtf
#endif
typedef real real2 __attribute__((ext_vector_type(2)));
typedef real real16 __attribute__((ext_vector_type(16)));
typedef real real32 __attribute__((ext_vector_type(32)));
typedef real real64 __attribute__((ext_vector_type(64)));
INLINE real sqrt_of_1(real x) { return SQRT1(x); }
INLINE real2 sqrt_of_2(real2 x) { return (real2)(SQRT1(x.s0), SQRT1(x.s1)); }
INLINE real4 sqrt_of_4(real4 x) {
  return (real4)(SQRT1(x.s0), SQRT1(x.s1), SQRT1(x.s2), SQRT1(x.s3));
}
INLINE real8 sqrt_of_8(real8 x) {
  return (real8)(SQRT1(x.s0), SQRT1(x.s1), SQRT1(x.s2), SQRT1(x.s3), SQRT1(x.s4), SQRT1(x.s5),
                 SQRT1(x.s6), SQRT1(x.s7));
}
#if DOUBLE_PRECISION
INLINE real16 sqrt_of_16(real16 x) {
  real16 y;
  y.lo = sqrt_of_8(x.lo);
  y.hi = sqrt_of_8(x.hi);
  return y;
}
#else
INLINE real16 sqrt_of_16(real16 x) {
  return (real16)(SQRT1(x.s0), SQRT1(x.s1), SQRT1(x.s2), SQRT1(x.s3), SQRT1(x.s4), SQRT1(x.s5),
                  SQRT1(x.s6), SQRT1(x.s7), SQRT1(x.s8), SQRT1(x.s9), SQRT1(x.sa), SQRT1(x.sb),
                  SQRT1(x.sc), SQRT1(x.sd), SQRT1(x.se), SQRT1(x.sf));
}
#endif
INLINE real32 sqrt_of_32(real32 x) {
  real32 y;
  y.lo = sqrt_of_16(x.lo);
  y.hi = sqrt_of_16(x.hi);
  return y;
}
INLINE real64 sqrt_of_64(real64 x) {
  real64 y;
  y.lo = sqrt_of_32(x.lo);
  y.hi = sqrt_of_32(x.hi);
  return y;
}
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
INLINE realv square_root(realv x) { return JOIN(sqrt_of_, WIDTH)(x); }
#endif

/* scalar_root - the square root of one number. */
#if CPU_BUILTINS
INLINE real scalar_root(real x) { return SQRT1(x); }
#else
INLINE real scalar_root(real x) { return sqrt(x); }
#endif

/* What is nearer by less than this factor lies in the same place; the earlier shape is then seen. */
#if DOUBLE_PRECISION
#define COINCIDENT (1 - 1.8e-15)
#else
#define COINCIDENT (1 - 4.8e-7f)
#endif

INLINE realv magnitude(realv x) { return x < 0 ? -x : x; }
INLINE realv larger(realv a, realv b) { return a > b ? a : b; }
INLINE realv smaller(realv a, realv b) { return a < b ? a : b; }

/* whole - the largest integer <= x, for |x| < 2^31. */
INLINE intv whole(realv x) {
  intv i = int_from_real(x);
  return i - (int_from_mask(real_from_int(i) > x) ? (intv)1 : (intv)0);
}

/* divide - quotients and rests of 0 <= a < 2^24 by n, without the division of integers, which is
 * done lane by lane.
 */
INLINE intv divide(intv a, int n, intv *rest) {
  intv quotient = int_from_real(real_from_int(a) * (R(1.0) / (real)n));
  intv left = a - quotient * n;
  /* The product may be off by one either way. */
  intv step = (left >= n ? (intv)1 : (intv)0) - (left < 0 ? (intv)1 : (intv)0);
  *rest = left - step * n;
  return quotient + step;
}

/* is_number - lanes that are neither infinite nor NaN. */
INLINE maskv is_number(realv x) { return x - x == 0; }

#if defined(__has_builtin)
#if __has_builtin(__builtin_reduce_max) && WIDTH > 1
#define HAS_REDUCTIONS 1
#endif
#endif

/* all_lanes - whether a condition holds in every lane. */
INLINE int all_lanes(maskv condition) {
#if WIDTH == 1
  return condition != 0;
#elif defined(HAS_REDUCTIONS)
  return __builtin_reduce_max(int_from_mask(condition)) != 0;
#else
  intv lanes = int_from_mask(condition);
  int all = -1;
#pragma unroll
  for (int i = 0; i < WIDTH; ++i) all &= lanes[i];
  return all != 0;
#endif
}

/* lane_numbers - 0, 1, ... WIDTH - 1. */
INLINE uintv lane_numbers(void) {
#if WIDTH == 1
  return 0;
#else
  uintv lanes;
#pragma unroll
  for (uint i = 0; i < WIDTH; ++i) lanes[i] = i;
  return lanes;
#endif
}

INLINE realv load_lanes(global const real *from, size_t group) {
  return *(global const realv_mem *)(from + group * WIDTH);
}
INLINE void store_lanes(realv value, global real *to, size_t group) {
  *(global realv_mem *)(to + group * WIDTH) = value;
}
INLINE void store_int_lanes(intv value, global int *to, size_t group) {
  *(global intv_mem *)(to + group * WIDTH) = value;
}

/* sine_cosine_quarter - sin x and cos x for |x| <= pi/4.
 *
 * Minimax polynomials: float 1 ulp, double 1e-16.  Source: S. Moshier, Cephes sinf/cosf and sin/cos.
 */
INLINE void sine_cosine_quarter(realv x, realv *sine, realv *cosine) {
  realv z = x * x;
#if DOUBLE_PRECISION
  realv s = 1.58962301576546568060e-10;
  s = mul_add(s, z, (realv)-2.50507477628578072866e-8);
  s = mul_add(s, z, (realv)2.75573136213857245213e-6);
  s = mul_add(s, z, (realv)-1.98412698295895385996e-4);
  s = mul_add(s, z, (realv)8.33333333332211858878e-3);
  s = mul_add(s, z, (realv)-1.66666666666666307295e-1);
  realv c = -1.13585365213876817300e-11;
  c = mul_add(c, z, (realv)2.08757008419747316778e-9);
  c = mul_add(c, z, (realv)-2.75573141792967388112e-7);
  c = mul_add(c, z, (realv)2.48015872888517045348e-5);
  c = mul_add(c, z, (realv)-1.38888888888730564116e-3);
  c = mul_add(c, z, (realv)4.16666666666665929218e-2);
#else
  realv s = -1.9515295891e-4f;
  s = mul_add(s, z, (realv)8.3321608736e-3f);
  s = mul_add(s, z, (realv)-1.6666654611e-1f);
  realv c = 2.443315711809948e-5f;
  c = mul_add(c, z, (realv)-1.388731625493765e-3f);
  c = mul_add(c, z, (realv)4.166664568298827e-2f);
#endif
  *sine = mul_add(x * z, s, x);
  *cosine = mul_add(z * z, c, mul_add(z, (realv)R(-0.5), (realv)R(1.0)));
}

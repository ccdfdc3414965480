// The generic types that every formula is written in.
//   scalar  one number (float or double)
//   real    the same number for WIDTH directions at once; WIDTH is 1 on a GPU
// Literals follow the precision: single builds pass -cl-single-precision-constant.
// Sums are always accumulated in double.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#if WIDTH == 1
#define VECTOR(type) type
#else
#define VECTOR(type) PASTE(type, WIDTH)
#endif

#if PRECISION == 64
typedef double scalar;
typedef VECTOR(double) real;
#else
typedef float scalar;
typedef VECTOR(float) real;
#endif

#define PI 3.14159265358979323846
#define INV_PI 0.31830988618379067154
#define LOG2_E 1.44269504088896340736

static inline real square(const real x) { return x * x; }

// fmax and fmin for numbers that are numbers: nothing to ask about NaN, half the time.
static inline real at_least(const real x, const real floor) { return x > floor ? x : floor; }
static inline real at_most(const real x, const real ceiling) { return x < ceiling ? x : ceiling; }

// log2(x) of a normal number x > 0, and log2(1 + x) of x > -1. In single precision PoCL's own
// spend most of their time on arguments that formulas never have: these are 3 times as fast,
// to 2e-7 (the polynomial of Cephes' logf on [sqrt(1/2), sqrt(2)), the exponent taken off).
#if PRECISION == 64
static inline real positive_log2(const real x) { return log2(x); }
static inline real log2_1p(const real x) { return M_LOG2E * log1p(x); }
#else
typedef VECTOR(int) integers;
static inline real log2_of_parts(const integers exponent, const real f) {
  const real f2 = f * f;
  real p = 7.0376836292e-2;
  p = p * f - 1.1514610310e-1;
  p = p * f + 1.1676998740e-1;
  p = p * f - 1.2420140846e-1;
  p = p * f + 1.4249322787e-1;
  p = p * f - 1.6668057665e-1;
  p = p * f + 2.0000714765e-1;
  p = p * f - 2.4999993993e-1;
  p = p * f + 3.3333331174e-1;
  const real rest = p * f * f2 - 0.5 * f2;  // ln(1 + f) - f
  return PASTE(convert_, VECTOR(float))(exponent) + M_LOG2E_F * rest + M_LOG2E_F * f;
}
static inline integers log2_exponent(const real x) {
  return (PASTE(as_, VECTOR(int))(x) - 0x3f3504f3) >> 23;
}
static inline real log2_mantissa(const real x, const integers exponent) {
  return PASTE(as_, VECTOR(float))(PASTE(as_, VECTOR(int))(x) - (exponent << 23));
}
static inline real positive_log2(const real x) {
  const integers exponent = log2_exponent(x);
  return log2_of_parts(exponent, log2_mantissa(x, exponent) - 1.0);
}
static inline real log2_1p(const real x) {
  const real whole = 1.0 + x;
  const integers exponent = log2_exponent(whole);
  // Where nothing is taken off, x itself is exact and 1 + x - 1 is not.
  return log2_of_parts(exponent, exponent == 0 ? x : log2_mantissa(whole, exponent) - 1.0);
}
#endif

// Square root of a number >= 0, by the compiler's own instruction where it has one: PoCL 3's
// sqrt of a vector is a call, four times as long, before which all registers are saved.
#if (WIDTH == 4 || WIDTH == 8) && defined(__has_builtin)
#if __has_builtin(__builtin_sqrt) && __has_builtin(__builtin_sqrtf)
#define LANE_ROOTS
#endif
#endif
#if PRECISION == 64
#define LANE_ROOT __builtin_sqrt
#else
#define LANE_ROOT __builtin_sqrtf
#endif
static inline real positive_root(const real x) {
#if !defined(LANE_ROOTS)
  return sqrt(x);
#elif WIDTH == 4
  return (real)(LANE_ROOT(x.s0), LANE_ROOT(x.s1), LANE_ROOT(x.s2), LANE_ROOT(x.s3));
#else
  return (real)(LANE_ROOT(x.s0), LANE_ROOT(x.s1), LANE_ROOT(x.s2), LANE_ROOT(x.s3),
                LANE_ROOT(x.s4), LANE_ROOT(x.s5), LANE_ROOT(x.s6), LANE_ROOT(x.s7));
#endif
}

// Sum over the lanes, in double.
#if WIDTH == 1
static inline double sum_lanes(const real x) { return x; }
#else
static inline double sum_quad(const double4 x) {
  const double2 y = x.lo + x.hi;
  return y.x + y.y;
}
#if WIDTH == 4
static inline double sum_lanes(const real x) { return sum_quad(convert_double4(x)); }
#else  // 8: by halves, since 512-bit conversions are what some runtimes break on
static inline double sum_lanes(const real x) {
  return sum_quad(convert_double4(x.lo) + convert_double4(x.hi));
}
#endif
#endif

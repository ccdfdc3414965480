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

static inline real square(const real x) { return x * x; }

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

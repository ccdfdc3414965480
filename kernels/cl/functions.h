// Other exp and log in place of those that formulas call, for charts of what they buy.
// FUNCTIONS: 1 the library's everywhere, 2 the device's native ones, 3 polynomials.
#if FUNCTIONS == 1
#define positive_log2(x) log2(x)
#define log2_1p(x) (LOG2_E * log1p(x))
#elif FUNCTIONS == 2
#undef exp2  // some runtimes have macros of these names
#undef exp
#undef log2
#undef log
#define exp2(x) native_exp2(x)
#define exp(x) native_exp(x)
#define log2(x) native_log2(x)
#define log(x) native_log(x)
#define positive_log2(x) native_log2(x)
#else
// 2^x = 2^n 2^f with f in [-1/2, 1/2]: Cephes' polynomial of exp2f, to 2e-8.
static inline real polynomial_exp2(const real y) {
#if PRECISION == 64
  const real x = at_most(at_least(y, -1000.0), 1000.0);
#else
  const real x = at_most(at_least(y, -125.0), 125.0);
#endif
  const real n = rint(x), f = x - n;
  real p = 1.535336188319500e-4;
  p = p * f + 1.339887440266574e-3;
  p = p * f + 9.618437357674640e-3;
  p = p * f + 5.550332471162809e-2;
  p = p * f + 2.402264791363012e-1;
  p = p * f + 6.931472028550421e-1;
  p = p * f + 1.0;
#if PRECISION == 64
  return p * PASTE(as_, VECTOR(double))((PASTE(convert_, VECTOR(long))(n) + 1023) << 52);
#else
  return p * PASTE(as_, VECTOR(float))((PASTE(convert_, VECTOR(int))(n) + 127) << 23);
#endif
}
#if PRECISION == 64
// The polynomial that types.h has in single precision, in double.
typedef VECTOR(long) long_integers;
static inline real polynomial_log2(const real x) {
  const long_integers bits = PASTE(as_, VECTOR(long))(x);
  const long_integers exponent = (bits - 0x3fe6a09e667f3bcdL) >> 52;
  const real f = PASTE(as_, VECTOR(double))(bits - (exponent << 52)) - 1.0;
  real p = 7.0376836292e-2;
  p = p * f - 1.1514610310e-1;
  p = p * f + 1.1676998740e-1;
  p = p * f - 1.2420140846e-1;
  p = p * f + 1.4249322787e-1;
  p = p * f - 1.6668057665e-1;
  p = p * f + 2.0000714765e-1;
  p = p * f - 2.4999993993e-1;
  p = p * f + 3.3333331174e-1;
  const real rest = p * f * f * f - 0.5 * f * f;
  return PASTE(convert_, VECTOR(double))(exponent) + LOG2_E * (rest + f);
}
#define positive_log2(x) polynomial_log2(x)
#endif
#define OVERLOADED static inline __attribute__((overloadable))
OVERLOADED real cheap_exp2(const real x) { return polynomial_exp2(x); }
OVERLOADED real cheap_exp(const real x) { return polynomial_exp2(LOG2_E * x); }
#if WIDTH > 1  // what is computed once stays as it is
OVERLOADED scalar cheap_exp2(const scalar x) { return exp2(x); }
OVERLOADED scalar cheap_exp(const scalar x) { return exp(x); }
#endif
#undef exp2
#undef exp
#define exp2(x) cheap_exp2(x)
#define exp(x) cheap_exp(x)
#endif

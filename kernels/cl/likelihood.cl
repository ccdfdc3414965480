// Fused log-likelihood over the directions, for many sets of parameters.
//
// With f = sum_k c_k b_k and the residual r = y - f this sums, per set and channel,
//   -0.5 (r^2 / v + ln v)                                   (Gaussian), or
//   -0.5 (nu + 1) ln(1 + r^2 / (nu v)) - 0.5 ln v           (STUDENT),
// where v = additive^2 + (relative f)^2, or with GIVEN v = sigma^2 scale^2, whose logarithm
// the host adds. Constants are the host's too. With CENSORED a value whose side is not 0 is only
// known to lie above (1) or below (-1) what stands for it: ln P of that.
//
// Terms have the precision of `real`; a block's few terms are added in it, blocks in double.
// Logarithms are taken of products: 16 mantissas of 1 to 2 cannot overflow, and exponents
// are added as integers.

#if PRECISION == 64
typedef VECTOR(long) bit_pattern;
#define AS_BITS PASTE(as_, VECTOR(long))
#define AS_REAL PASTE(as_, VECTOR(double))
#define TO_REAL PASTE(convert_, VECTOR(double))
#define MANTISSA_BITS 52
#define MANTISSA_MASK 0x000fffffffffffffL
#define ONE_BITS 0x3ff0000000000000L
#define BIAS 1023
#define FAR_TAIL -20.0
#else
typedef VECTOR(int) bit_pattern;
#define AS_BITS PASTE(as_, VECTOR(int))
#define AS_REAL PASTE(as_, VECTOR(float))
#define TO_REAL PASTE(convert_, VECTOR(float))
#define MANTISSA_BITS 23
#define MANTISSA_MASK 0x007fffff
#define ONE_BITS 0x3f800000
#define BIAS 127
#define FAR_TAIL -9.0
#endif
#define LN_2 0.69314718055994530942
#define LN_SQRT_2_PI 0.91893853320467274178
#define SQRT_1_2 0.70710678118654752440

// A product of positive numbers as mantissas and exponents, and its logarithm.
typedef struct { real mantissa; bit_pattern exponent; } product;

static inline void times(product *p, const real v) {
  const bit_pattern bits = AS_BITS(v);
  p->mantissa *= AS_REAL((bits & MANTISSA_MASK) | ONE_BITS);
  p->exponent += bits >> MANTISSA_BITS;
}

static inline real log_of(const product p) {  // of BLOCK factors
  return LN_2 * (positive_log2(p.mantissa) + TO_REAL(p.exponent - BLOCK * BIAS));
}

#if CENSORED
// ln of the normal distribution function: by erfc, far below by the asymptotic series.
static inline real log_normal_cdf(const real z) {
  const real tail = fmin(z, FAR_TAIL);
  const real inverse = 1.0 / (tail * tail);
  const real series =
      1.0 + inverse * (-1.0 + inverse * (3.0 + inverse * (-15.0 + inverse * 105.0)));
  const real far = -0.5 * tail * tail - LN_SQRT_2_PI - log(-tail) + log(series);
  const real near = log(0.5 * erfc(-SQRT_1_2 * fmax(z, FAR_TAIL)));
  return z < FAR_TAIL ? far : near;
}
#endif

// With CHANNEL_X each channel has nonlinear parameters of its own.
#if CHANNEL_X
#define N_GROUPS n_channels
#else
#define N_GROUPS 1
#endif
#define N_NOISE 3

// The log-likelihood of a block's values in one channel. `noise` has additive^2 and relative^2,
// or 1/scale^2 and nothing; and nu.
static inline real block_sum(real columns[BLOCK][N_BASIS], global const real *values,
                             global const real *weights, global const real *sides,
                             const int first, const int stride,
                             global const scalar *coefficient, global const scalar *noise) {
  real acc = 0.0;
  product spread = {1.0, 0}, tail = {1.0, 0};
  for (int b = 0; b < BLOCK; ++b) {
    const int v = first + b * stride;
    real f = coefficient[0] * columns[b][0];
    for (int k = 1; k < N_BASIS; ++k) f += coefficient[k] * columns[b][k];
    const real residual = values[v] - f;
    const real w = weights[v];
#if GIVEN
    const real variance = 1.0, inverse = w * noise[0];
#else
    // What is missing has weight 0 and counts as met exactly, with variance 1.
    const real variance = w > 0.0 ? noise[0] + noise[1] * f * f : 1.0;
    const real inverse = w / variance;
#endif
    const real z2 = residual * residual * inverse;
#if CENSORED
    const real side = sides[v];
    const real beyond = log_normal_cdf(-side * residual * sqrt(inverse));
    acc += side != 0.0 ? -2.0 * beyond : z2;
    const real counted = side != 0.0 ? 1.0 : variance;
#else
    const real counted = variance;
#if STUDENT
    times(&tail, 1.0 + z2 / noise[2]);
#else
    acc += z2;
#endif
#endif
#if !GIVEN
    times(&spread, counted);
#endif
  }
#if STUDENT
  acc += (noise[2] + 1.0) * log_of(tail);
#endif
#if !GIVEN
  acc += log_of(spread);
#endif
  return -0.5 * acc;
}

kernel void log_likelihood(global const real *planes, const int n, global const real *values,
                           global const real *weights, global const real *sides,
                           const int n_channels, global const scalar *parameters,
                           const int n_chunks, const int blocks_per_chunk, global double *out) {
  const int chunk = get_global_id(0), set = get_global_id(1), n_sets = get_global_size(1);
  global const scalar *all_x = parameters;
  global const scalar *coefficients = all_x + n_sets * N_GROUPS * N_X;
  global const scalar *noise = coefficients + n_sets * n_channels * N_BASIS;
  global double *sums = out + (size_t)(chunk * n_sets + set) * n_channels;
  for (int channel = 0; channel < n_channels; ++channel) sums[channel] = 0.0;

  for (int group = 0; group < N_GROUPS; ++group) {
    const constants c = prepare(all_x + (set * N_GROUPS + group) * N_X);
    for (int block = 0; block < blocks_per_chunk; ++block) {
#if STRIDED
      const int first = block * BLOCK * n_chunks + chunk, stride = n_chunks;
#else
      const int first = (chunk * blocks_per_chunk + block) * BLOCK, stride = 1;
#endif
      real columns[BLOCK][N_BASIS];
      for (int b = 0; b < BLOCK; ++b)
        evaluate_basis(load_geometry(planes, n, first + b * stride), &c, columns[b]);
#if CHANNEL_X
      {
        const int channel = group;
#else
      for (int channel = 0; channel < n_channels; ++channel) {
#endif
        const int row = set * n_channels + channel;
        sums[channel] += sum_lanes(block_sum(columns, values + channel * n, weights + channel * n,
                                             sides + channel * n, first, stride,
                                             coefficients + row * N_BASIS, noise + row * N_NOISE));
      }
    }
  }
}

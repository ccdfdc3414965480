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
// Logarithms are taken of products: mantissas of 1 to 2 are multiplied, a block at a time, which
// cannot overflow, and exponents are added as integers.

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

// Brings the mantissa back to 1 to 2 before it overflows.
static inline void settle(product *p) {  // after BLOCK factors
  const bit_pattern bits = AS_BITS(p->mantissa);
  p->mantissa = AS_REAL((bits & MANTISSA_MASK) | ONE_BITS);
  p->exponent += (bits >> MANTISSA_BITS) - (BLOCK + 1) * BIAS;
}

static inline real log_of(const product p) {
  return LN_2 * (positive_log2(p.mantissa) + TO_REAL(p.exponent));
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
#define N_GROUPS N_CHANNELS
#else
#define N_GROUPS 1
#endif
#define N_NOISE 3

// What a chunk's values have added up to in one channel: a block's sum of squares, and products
// over all blocks, whose logarithm is taken once.
typedef struct { real squares; product spread, tail; } partial;

// `noise` has additive^2 and relative^2, or 1/scale^2 and nothing; and nu.
static inline void add_value(partial *p, const real *basis, const scalar *coefficient,
                             const scalar *noise, const real value, const real w,
                             const real side) {
  real f = coefficient[0] * basis[0];
#pragma unroll
  for (int k = 1; k < N_BASIS; ++k) f += coefficient[k] * basis[k];
  const real residual = value - f;
#if GIVEN
  const real variance = 1.0, inverse = w * noise[0];
#else
  // What is missing has weight 0 and counts as met exactly, with variance 1.
  const real variance = w > 0.0 ? noise[0] + noise[1] * f * f : 1.0;
  const real inverse = w / variance;
#endif
  const real z2 = residual * residual * inverse;
#if CENSORED
  const real beyond = log_normal_cdf(-side * residual * sqrt(inverse));
  p->squares += side != 0.0 ? -2.0 * beyond : z2;
  const real counted = side != 0.0 ? 1.0 : variance;
#else
  const real counted = variance;
#if STUDENT
  times(&p->tail, 1.0 + z2 / noise[2]);
#else
  p->squares += z2;
#endif
#endif
#if !GIVEN
  times(&p->spread, counted);
#endif
}

// Loops over a group's channels.
#if CHANNEL_X
#define EACH_CHANNEL(channel) for (int channel = group; channel == group; ++channel)
#else
#define EACH_CHANNEL(channel) for (int channel = 0; channel < N_CHANNELS; ++channel)
#endif

// Neighbours on a CPU share directions, which stay in its caches; on a GPU they read neighbours.
kernel void log_likelihood(global const real *planes, const int n, global const real *values,
                           global const real *weights, global const real *sides,
                           global const scalar *parameters, const int n_chunks,
                           const int blocks_per_chunk, global double *out) {
#if STRIDED
  const int chunk = get_global_id(0), set = get_global_id(1), n_sets = get_global_size(1);
#else
  const int chunk = get_global_id(1), set = get_global_id(0), n_sets = get_global_size(0);
#endif
  global const scalar *all_x = parameters;
  global const scalar *coefficients = all_x + n_sets * N_GROUPS * N_X;
  global const scalar *noises = coefficients + n_sets * N_CHANNELS * N_BASIS;
  global double *sums = out + (size_t)(chunk * n_sets + set) * N_CHANNELS;

  for (int group = 0; group < N_GROUPS; ++group) {
    const constants c = prepare(all_x + (set * N_GROUPS + group) * N_X);
    partial parts[N_CHANNELS];
    EACH_CHANNEL(channel) {
      const partial nothing = {0.0, {1.0, 0}, {1.0, 0}};
      parts[channel] = nothing;
      sums[channel] = 0.0;
    }
    for (int block = 0; block < blocks_per_chunk; ++block) {
#if STRIDED
      const int first = block * BLOCK * n_chunks + chunk, stride = n_chunks;
#else
      const int first = (chunk * blocks_per_chunk + block) * BLOCK, stride = 1;
#endif
      // In two loops: one would be a chain of operations longer than a CPU looks ahead.
      real columns[BLOCK][N_BASIS];
      for (int b = 0; b < BLOCK; ++b)
        evaluate_row(planes, n, first + b * stride, &c, columns[b]);
      EACH_CHANNEL(channel) {
        const int row = set * N_CHANNELS + channel;
        scalar coefficient[N_BASIS], noise[N_NOISE];
#pragma unroll
        for (int k = 0; k < N_BASIS; ++k) coefficient[k] = coefficients[row * N_BASIS + k];
#pragma unroll
        for (int k = 0; k < N_NOISE; ++k) noise[k] = noises[row * N_NOISE + k];
        partial p = parts[channel];
        p.squares = 0.0;
        for (int b = 0; b < BLOCK; ++b) {
          const int v = channel * n + first + b * stride;
          add_value(&p, columns[b], coefficient, noise, values[v], weights[v], sides[v]);
        }
        sums[channel] -= 0.5 * sum_lanes(p.squares);
#if STUDENT
        settle(&p.tail);
#endif
#if !GIVEN
        settle(&p.spread);
#endif
        parts[channel] = p;
      }
    }
    EACH_CHANNEL(channel) {
#if STUDENT
      const scalar nu = noises[(set * N_CHANNELS + channel) * N_NOISE + 2];
      sums[channel] -= 0.5 * (nu + 1.0) * sum_lanes(log_of(parts[channel].tail));
#endif
#if !GIVEN
      sums[channel] -= 0.5 * sum_lanes(log_of(parts[channel].spread));
#endif
    }
  }
}

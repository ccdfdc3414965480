// Fused weighted sums over the directions, never writing values out.
//
// With f = sum_k c_k b_k, the residual r = T(y) - T(f) and the columns
// J_m = T'(f) (b_m, or derivatives of b along x) this sums, per set and channel,
//   w r^2   and, with GRAM,   w J_m r   and   w J_l J_m (l <= m).
// y arrives transformed by the host. Terms have the precision of `real`; a
// block's few terms are added in it, blocks are added in double.
//
// A work-item owns one chunk of directions and one set. On a CPU a chunk is
// contiguous (STRIDED 0); on a GPU neighbours read neighbours (STRIDED 1).

// n_i is cos(theta_i), plane 0 of the directions.
#if METRIC == 0  // identity
#define TRANSFORM(f, n_i) (f)
#define SLOPE(f, t, n_i) ((real)(1.0))
#elif METRIC == 1  // logarithm
#define TRANSFORM(f, n_i) log(f)
#define SLOPE(f, t, n_i) (1.0 / (f))
#elif METRIC == 2  // cube root
#define TRANSFORM(f, n_i) exp2(log2(f) * (1.0 / 3.0))
#define SLOPE(f, t, n_i) ((t) / (3.0 * (f)))
#else  // logarithm of 1 + f cos(theta_i)
#define TRANSFORM(f, n_i) log1p((f) * (n_i))
#define SLOPE(f, t, n_i) ((n_i) / (1.0 + (f) * (n_i)))
#endif

// With CHANNEL_X each channel has nonlinear parameters of its own.
#if CHANNEL_X
#define N_GROUPS n_channels
#else
#define N_GROUPS 1
#endif

#if GRAM
#define N_SUMS (1 + N_COLUMNS + N_COLUMNS * (N_COLUMNS + 1) / 2)
#else
#define N_SUMS 1
#endif

kernel void weighted_sums(global const real *planes, const int n, global const real *values,
                          global const real *weights, const int n_channels,
                          global const scalar *parameters, const scalar tiny,
                          const int n_chunks, const int blocks_per_chunk, global double *out) {
  const int chunk = get_global_id(0), set = get_global_id(1), n_sets = get_global_size(1);
  const int n_x = n_sets * N_GROUPS * N_X;
  global const scalar *all_x = parameters, *all_centres = all_x + n_x;
  global const scalar *all_steps = all_centres + n_x, *coefficients = all_steps + n_x;
  global double *sums = out + (size_t)(set * n_chunks + chunk) * n_channels * N_SUMS;
  for (int s = 0; s < n_channels * N_SUMS; ++s) sums[s] = 0.0;

  for (int group = 0; group < N_GROUPS; ++group) {
    global const scalar *x = all_x + (set * N_GROUPS + group) * N_X;
    const constants c = prepare(x);
#if DERIVATIVES
    global const scalar *centres = all_centres + (set * N_GROUPS + group) * N_X;
    global const scalar *steps = all_steps + (set * N_GROUPS + group) * N_X;
    constants ahead[N_X], behind[N_X];
    for (int j = 0; j < N_X; ++j) {
      scalar moved[N_X];
      for (int i = 0; i < N_X; ++i) moved[i] = i == j ? centres[i] : x[i];
      moved[j] += steps[j];
      ahead[j] = prepare_private(moved);
      moved[j] -= 2 * steps[j];
      behind[j] = prepare_private(moved);
    }
#endif
    for (int block = 0; block < blocks_per_chunk; ++block) {
      real columns[BLOCK][N_COLUMNS];
#if STRIDED
      const int first = block * BLOCK * n_chunks + chunk, stride = n_chunks;
#else
      const int first = (chunk * blocks_per_chunk + block) * BLOCK, stride = 1;
#endif
      for (int b = 0; b < BLOCK; ++b) {
        const int row = first + b * stride;
        evaluate_row(planes, n, row, &c, columns[b]);
#if DERIVATIVES
        for (int j = 0; j < N_X; ++j) {
          real plus[N_BASIS], minus[N_BASIS];
          evaluate_row(planes, n, row, &ahead[j], plus);
          evaluate_row(planes, n, row, &behind[j], minus);
          const scalar per_step = steps[j] > 0.0 ? 0.5 / steps[j] : 0.0;
          fill_derivatives(j, plus, minus, per_step, columns[b] + N_BASIS);
        }
#endif
      }
#if CHANNEL_X
      {
        const int channel = group;
#else
      for (int channel = 0; channel < n_channels; ++channel) {
#endif
        global const scalar *coefficient = coefficients + (set * n_channels + channel) * N_BASIS;
        real acc[N_SUMS];
        for (int s = 0; s < N_SUMS; ++s) acc[s] = 0.0;
        for (int b = 0; b < BLOCK; ++b) {
          const int v = channel * n + first + b * stride;
          real f = coefficient[0] * columns[b][0];
          for (int k = 1; k < N_BASIS; ++k) f += coefficient[k] * columns[b][k];
#if METRIC != 0
          f = fmax(f, tiny);
#endif
          const real t = TRANSFORM(f, planes[first + b * stride]);
          const real residual = values[v] - t;
          const real w = weights[v];
#if GRAM
          const real weighted_residual = w * residual;
          acc[0] += weighted_residual * residual;
          const real slope = SLOPE(f, t, planes[first + b * stride]);
          int s = 1 + N_COLUMNS;
          for (int l = 0; l < N_COLUMNS; ++l) {
            const real column = slope * columns[b][l];
            acc[1 + l] += weighted_residual * column;
            const real weighted = w * slope * column;
            for (int m = l; m < N_COLUMNS; ++m) acc[s++] += weighted * columns[b][m];
          }
#else
          acc[0] += w * residual * residual;
#endif
        }
        for (int s = 0; s < N_SUMS; ++s) sums[channel * N_SUMS + s] += sum_lanes(acc[s]);
      }
    }
  }
}

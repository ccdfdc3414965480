// Normal equations of a texel in (t, d), and what is left of them along t.
typedef struct {
  real chi_square, power, squares, log_weights;
  real gram[N_GRAMS][TRIANGLE(N_D)];
  real rhs[N_CHANNELS][N_D];
  real gradient[LEAST_ONE(N_T)], curvature[LEAST_ONE(TRIANGLE(N_T))];
  real cross[N_CHANNELS][LEAST_ONE(N_T)][N_D];
} sums;
#define N_SUMS (sizeof(sums) / sizeof(real))

// Sum the normal equations of (t, d) around a point. `judge`: also what only the last pass asks
// for.
static inline void sum_up(global const number *planes, const int n_padded, const int n,
                          global const real *values, global const real *weights, const int group,
                          const int n_groups, const real *t, real d[N_CHANNELS][N_D],
                          const int judge, sums *total) {
  scalar x[LEAST_ONE(N_X)];
  search_to_parameters(t, x);
  const constants at = prepare_private(x);
  constants ahead[LEAST_ONE(N_T)], behind[LEAST_ONE(N_T)];
  for (int j = 0; j < N_T; ++j) {
    real moved[LEAST_ONE(N_T)];
    for (int i = 0; i < N_T; ++i) moved[i] = t[i];
    // Beside a bound the differences are taken a step inside it: beyond there may be none.
    const real centre = at_most(at_least(t[j], T_LOW[j] + STEP), T_HIGH[j] - STEP);
    moved[j] = centre + STEP;
    search_to_parameters(moved, x);
    ahead[j] = prepare_private(x);
    moved[j] = centre - STEP;
    search_to_parameters(moved, x);
    behind[j] = prepare_private(x);
  }
  for (int k = 0; k < N_SUMS; ++k) ((real *)total)[k] = (real)(0.0);
  for (int first = 0; first < n; first += SAMPLES) {
    sums part;
    for (int k = 0; k < N_SUMS; ++k) ((real *)&part)[k] = (real)(0.0);
    const int last = min(first + SAMPLES, n);
    for (int s = first; s < last; ++s) {
      const geometry g = broadcast_geometry(planes, n_padded, s);
      real basis[N_BASIS], column[N_D + 1], slope[LEAST_ONE(N_T)][N_D + 1];
      evaluate_basis(g, &at, basis);
      to_columns(basis, column);
      for (int j = 0; j < N_T; ++j) {
        real other[N_D + 1];
        evaluate_basis(g, &ahead[j], basis);
        to_columns(basis, slope[j]);
        evaluate_basis(g, &behind[j], basis);
        to_columns(basis, other);
        for (int k = 0; k <= N_D; ++k) slope[j][k] = (slope[j][k] - other[k]) * (0.5 / STEP);
      }
#if !WEIGHTED
      for (int k = 0; k < N_D; ++k)
        for (int l = 0; l <= k; ++l) part.gram[0][AT_OR_BELOW(k, l)] += column[k] * column[l];
#endif
      for (int c = 0; c < N_CHANNELS; ++c) {
        const size_t where = VALUE(group, n_groups, n, s, c);
        real f = column[N_D];
        for (int k = 0; k < N_D; ++k) f += d[c][k] * column[k];
        const real residual = values[where] - f;
#if WEIGHTED
        const real w = weights[where], weighted = w * residual;
        part.power += w * square(values[where]);
        for (int k = 0; k < N_D; ++k)
          for (int l = 0; l <= k; ++l)
            part.gram[c][AT_OR_BELOW(k, l)] += w * column[k] * column[l];
        if (judge) {
          const mask there = w > 0.0;
          const real known = WHERE(there, w, (real)(1.0));
          part.squares += WHERE(there, residual * residual, (real)(0.0));
          part.log_weights += positive_log2(known);
        }
#else
        const real weighted = residual;
        part.power += square(values[where]);
        if (judge) part.squares += residual * residual;
#endif
        part.chi_square += weighted * residual;
        for (int k = 0; k < N_D; ++k) part.rhs[c][k] += weighted * column[k];
        real J[LEAST_ONE(N_T)];
        for (int j = 0; j < N_T; ++j) {
          J[j] = slope[j][N_D];
          for (int k = 0; k < N_D; ++k) J[j] += d[c][k] * slope[j][k];
          part.gradient[j] += weighted * J[j];
#if WEIGHTED
          const real wJ = w * J[j];
#else
          const real wJ = J[j];
#endif
          for (int k = 0; k < N_D; ++k) part.cross[c][j][k] += wJ * column[k];
          for (int i = 0; i <= j; ++i) part.curvature[AT_OR_BELOW(j, i)] += wJ * J[i];
        }
      }
    }
    for (int k = 0; k < N_SUMS; ++k) ((real *)total)[k] += ((real *)&part)[k];
  }
}

// Solve for the coordinates of all channels at the sums' t; returns what is gained.
static inline real solve_channels(const sums *s, real d[N_CHANNELS][N_D],
                                  real move[N_CHANNELS][N_D], real is_free[N_CHANNELS][N_D]) {
  real gain = (real)(0.0);
  for (int c = 0; c < N_CHANNELS; ++c)
    gain += solve_bounded(s->gram[WEIGHTED ? c : 0], s->rhs[c], d[c], move[c], is_free[c]);
  return gain;
}

// Eliminate the free coordinates: what is left of curvature and gradient along t.
static inline void eliminate(const sums *s, real move[N_CHANNELS][N_D],
                             real is_free[N_CHANNELS][N_D], real *schur, real *reduced) {
  for (int j = 0; j < N_T; ++j) reduced[j] = s->gradient[j];
  for (int k = 0; k < TRIANGLE(N_T); ++k) schur[k] = s->curvature[k];
  for (int c = 0; c < N_CHANNELS; ++c) {
    real L[TRIANGLE(N_D)];
    factorise(s->gram[WEIGHTED ? c : 0], is_free[c], N_D, RIDGE, L);
    for (int j = 0; j < N_T; ++j) {
      real lever[N_D];
      for (int k = 0; k < N_D; ++k) {
        reduced[j] -= s->cross[c][j][k] * move[c][k];
        lever[k] = s->cross[c][j][k] * is_free[c][k];
      }
      substitute(L, N_D, lever);
      for (int i = 0; i <= j; ++i)
        for (int k = 0; k < N_D; ++k)
          schur[AT_OR_BELOW(j, i)] -= s->cross[c][i][k] * is_free[c][k] * lever[k];
    }
  }
}

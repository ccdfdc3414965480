// Gauss-Newton with a safeguarded step over t with the coordinates d solved exactly at each t; t is both the
// start and the result. Rows of state: d, then the value reached, then 1 where it converged. A
// walk that is not fresh goes on with the coordinates in the state.
kernel void refine_texels(global const number *planes, const int n_padded, const int n,
                          global const real *values, global const real *weights,
                          const int fresh, const int most_steps, const number gain_wanted,
                          global real *search, global real *state) {
  const int group = get_global_id(0), n_groups = get_global_size(0);
  real t[LEAST_ONE(N_T)], best_t[LEAST_ONE(N_T)], best_reduced[LEAST_ONE(N_T)], step[LEAST_ONE(N_T)];
  real d[N_CHANNELS][N_D], best_d[N_CHANNELS][N_D], move[N_CHANNELS][N_D];
  real is_free[N_CHANNELS][N_D];
  sums s;
  for (int j = 0; j < N_T; ++j) {
    best_t[j] = t[j] = search[ROW(j, group, n_groups)];
    step[j] = best_reduced[j] = (real)(0.0);
  }
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k)
      d[c][k] = best_d[c][k] =
          fresh ? (real)(LOW[k]) : state[ROW(c * N_D + k, group, n_groups)];

  real best = (real)(HUGE_NUMBER), promised = (real)(0.0);
  real best_doubt = (real)(0.0), rejected = (real)(0.0);
  mask going = (real)(0.0) == (real)(0.0), converged = !going;
  // Round 0 only finds coordinates at the start; their rounding goes away in those that follow.
  for (int round = fresh ? 0 : 1; round <= most_steps && ANY(going); ++round) {
    sum_up(planes, n_padded, n, values, weights, group, n_groups, t, d, 0, &s);
    const real value = s.chi_square - solve_channels(&s, d, move, is_free);
    const real power = s.power, floor = power * (ROUNDING * ROUNDING);
    if (round == 0) {
      for (int c = 0; c < N_CHANNELS; ++c)
        for (int k = 0; k < N_D; ++k) d[c][k] += move[c][k];
      continue;
    }
    // A bright reading is rounded by more than the scatter tells apart, and a large sum from
    // which a large gain is taken leaves its rounding behind.
    const real doubt = ROUNDING * (4.0 * s.chi_square + 0.25 * sqrt(s.chi_square) * sqrt(power));
    const mask better = going & (value <= best + doubt + best_doubt + floor);
    best_doubt = WHERE(better, doubt, best_doubt);
    const mask worse = going & !better;
    for (int c = 0; c < N_CHANNELS; ++c)
      for (int k = 0; k < N_D; ++k)
        best_d[c][k] = WHERE(better, d[c][k] + move[c][k], best_d[c][k]);

    real schur[LEAST_ONE(TRIANGLE(N_T))], reduced[LEAST_ONE(N_T)], in[LEAST_ONE(N_T)];
    eliminate(&s, move, is_free, schur, reduced);
    for (int j = 0; j < N_T; ++j) {
      const mask out = ((t[j] <= (real)(T_LOW[j])) & (reduced[j] <= 0.0)) |
                       ((t[j] >= (real)(T_HIGH[j])) & (reduced[j] >= 0.0));
      in[j] = WHERE(out, (real)(0.0), (real)(1.0));
    }
    // What the gradient did along the step that led here tells the curvature that Gauss-Newton
    // leaves out: with readings far from the model it is as large as what is there.
    real along = (real)(0.0), expected = (real)(0.0);
    for (int j = 0; j < N_T; ++j) {
      const real moved = t[j] - best_t[j];
      along += moved * (best_reduced[j] - reduced[j]);
      for (int i = 0; i < N_T; ++i) expected += moved * schur[ENTRY(j, i)] * (t[i] - best_t[i]);
    }
    const mask told = better & (expected > floor);
    const real ratio = along / WHERE(told, expected, (real)(1.0));
    const real stretch = WHERE(told, at_most(at_least(ratio, (real)(0.1)), (real)(10.0)), (real)(1.0));
    for (int k = 0; k < TRIANGLE(N_T); ++k) schur[k] *= stretch;
    best = WHERE(better, value, best);
    for (int j = 0; j < N_T; ++j) {
      best_t[j] = WHERE(better, t[j], best_t[j]);
      best_reduced[j] = WHERE(better, reduced[j], best_reduced[j]);
    }
    real L[LEAST_ONE(TRIANGLE(N_T))], full[LEAST_ONE(N_T)];
    for (int j = 0; j < N_T; ++j) full[j] = reduced[j] * in[j];
    factorise(schur, in, N_T, RIDGE, L);
    substitute(L, N_T, full);
    real gain = (real)(0.0);
    for (int j = 0; j < N_T; ++j) gain += full[j] * reduced[j] * in[j];
    promised = WHERE(better, gain, promised);
    const mask done = better & (gain <= at_least(gain_wanted * value, floor));
    rejected = WHERE(better, (real)(0.0), rejected + 1.0);
    for (int j = 0; j < N_T; ++j) {
      const real bounded = at_most(at_least(full[j], (real)(-MOST_MOVE[j])), (real)(MOST_MOVE[j]));
      step[j] = WHERE(better, bounded, 0.25 * step[j]);
      const real next = at_most(at_least(best_t[j] + step[j], (real)(T_LOW[j])), (real)(T_HIGH[j]));
      t[j] = WHERE(going, next, t[j]);
    }
    for (int c = 0; c < N_CHANNELS; ++c)
      for (int k = 0; k < N_D; ++k) d[c][k] = best_d[c][k];
    // No step lowers the sum: the valley's floor, if the promise was small against the scatter.
    const mask stuck = worse & (rejected > 6.5);
    converged |= done | (stuck & (promised <= 100.0 * at_least(gain_wanted * best, floor)));
    going &= !(done | stuck);
  }
  for (int j = 0; j < N_T; ++j) search[ROW(j, group, n_groups)] = best_t[j];
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k)
      state[ROW(c * N_D + k, group, n_groups)] = most_steps > 0 ? best_d[c][k] : d[c][k];
  state[ROW(N_CHANNELS * N_D, group, n_groups)] = best;
  state[ROW(N_CHANNELS * N_D + 1, group, n_groups)] = WHERE(converged, (real)(1.0), (real)(0.0));
}

#if WEIGHTED
// Weights 1/(relative^2 f^2 + additive^2 + (floor of the channel's mean)^2) from the model at
// hand; what has no weight keeps none.
kernel void weigh_texels(global const number *planes, const int n_padded, const int n,
                         global const real *values, global real *weights,
                         const number relative2, const number additive2, const number floor2,
                         global const real *search, global const real *state) {
  const int group = get_global_id(0), n_groups = get_global_size(0);
  real t[LEAST_ONE(N_T)];
  scalar x[LEAST_ONE(N_X)];
  for (int j = 0; j < N_T; ++j) t[j] = search[ROW(j, group, n_groups)];
  search_to_parameters(t, x);
  const constants at = prepare_private(x);
  real mean2[N_CHANNELS], all = (real)(0.0);
  for (int c = 0; c < N_CHANNELS; ++c) {
    real sum = (real)(0.0), count = (real)(0.0);
    for (int s = 0; s < n; ++s) {
      const size_t where = VALUE(group, n_groups, n, s, c);
      sum += fabs(values[where]);
      count += WHERE(weights[where] > 0.0, (real)(1.0), (real)(0.0));
    }
    mean2[c] = square(sum / at_least(count, (real)(1.0)));
    all = at_least(all, mean2[c]);
  }
  for (int s = 0; s < n; ++s) {
    real basis[N_BASIS], column[N_D + 1];
    evaluate_basis(broadcast_geometry(planes, n_padded, s), &at, basis);
    to_columns(basis, column);
    for (int c = 0; c < N_CHANNELS; ++c) {
      const size_t where = VALUE(group, n_groups, n, s, c);
      real f = column[N_D];
      for (int k = 0; k < N_D; ++k) f += state[ROW(c * N_D + k, group, n_groups)] * column[k];
      // A channel that is dark altogether is held against the brightest one.
      const real variance = relative2 * f * f + additive2 + floor2 * (mean2[c] + 1e-4 * all);
      weights[where] = WHERE(weights[where] > 0.0, 1.0 / variance, (real)(0.0));
    }
  }
}
#endif

// The last pass: coordinates, scatter and variances where the refinement ended. Rows: d, chi-square, the
// readings' weighted squares, plain squares, log2 of the weights; inverse of the curvature along t; per channel the variances of d.
kernel void judge_texels(global const number *planes, const int n_padded, const int n,
                         global const real *values, global const real *weights,
                         global const real *search, global const real *state,
                         global real *judged) {
  const int group = get_global_id(0), n_groups = get_global_size(0);
  real t[LEAST_ONE(N_T)], d[N_CHANNELS][N_D], move[N_CHANNELS][N_D], is_free[N_CHANNELS][N_D];
  sums s;
  for (int j = 0; j < N_T; ++j) t[j] = search[ROW(j, group, n_groups)];
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k) d[c][k] = state[ROW(c * N_D + k, group, n_groups)];
  sum_up(planes, n_padded, n, values, weights, group, n_groups, t, d, 1, &s);
  s.chi_square -= solve_channels(&s, d, move, is_free);
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k) d[c][k] += move[c][k];
  int row = 0;
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k) judged[ROW(row++, group, n_groups)] = d[c][k];
  judged[ROW(row++, group, n_groups)] = s.chi_square;
  judged[ROW(row++, group, n_groups)] = s.power;
  judged[ROW(row++, group, n_groups)] = s.squares;
  judged[ROW(row++, group, n_groups)] = s.log_weights;
  for (int c = 0; c < N_CHANNELS; ++c)
    for (int k = 0; k < N_D; ++k) move[c][k] = (real)(0.0);
  real schur[LEAST_ONE(TRIANGLE(N_T))], reduced[LEAST_ONE(N_T)], in[LEAST_ONE(N_T)];
  real L[LEAST_ONE(TRIANGLE(N_T))], inverse[LEAST_ONE(N_T)][LEAST_ONE(N_T)];
  eliminate(&s, move, is_free, schur, reduced);
  for (int j = 0; j < N_T; ++j) {
    const mask out = (t[j] <= (real)(T_LOW[j])) | (t[j] >= (real)(T_HIGH[j]));
    in[j] = WHERE(out, (real)(0.0), (real)(1.0));
  }
  factorise(schur, in, N_T, RIDGE, L);
  for (int j = 0; j < N_T; ++j) {
    for (int i = 0; i < N_T; ++i) inverse[j][i] = i == j ? in[j] : (real)(0.0);
    substitute(L, N_T, inverse[j]);
    // Rows and columns that are held are the unit matrix's in the factor.
    for (int i = 0; i < N_T; ++i) inverse[j][i] *= in[i];
    for (int i = 0; i <= j; ++i) judged[ROW(row++, group, n_groups)] = inverse[j][i];
  }
  for (int c = 0; c < N_CHANNELS; ++c) {
    real G[TRIANGLE(N_D)], lever[LEAST_ONE(N_T)][N_D];
    factorise(s.gram[WEIGHTED ? c : 0], is_free[c], N_D, RIDGE, G);
    for (int j = 0; j < N_T; ++j) {
      for (int k = 0; k < N_D; ++k) lever[j][k] = s.cross[c][j][k] * is_free[c][k];
      substitute(G, N_D, lever[j]);
    }
    for (int k = 0; k < N_D; ++k) {
      real unit[N_D];
      for (int l = 0; l < N_D; ++l) unit[l] = l == k ? is_free[c][k] : (real)(0.0);
      substitute(G, N_D, unit);
      for (int l = 0; l <= k; ++l) {
        real variance = unit[l] * is_free[c][l];
        for (int j = 0; j < N_T; ++j)
          for (int i = 0; i < N_T; ++i)
            variance += lever[j][k] * inverse[j][i] * lever[i][l] * is_free[c][k] * is_free[c][l];
        judged[ROW(row++, group, n_groups)] = variance;
      }
    }
  }
}

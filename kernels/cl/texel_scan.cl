// Bring the texels of a launch into vectors; a reading that is no number gets no weight.
kernel void load_texels(global const number *readings, const int n_texels, const int n,
                        const int weigh, global real *values, global real *weights) {
  const int group = get_global_id(0), n_groups = get_global_size(0);
  for (int s = 0; s < n; ++s) {
    for (int c = 0; c < N_CHANNELS; ++c) {
      number lanes[WIDTH], present[WIDTH];
      for (int lane = 0; lane < WIDTH; ++lane) {
        const int texel = min(group * WIDTH + lane, n_texels - 1);
        const number y = readings[((size_t)texel * n + s) * N_CHANNELS + c];
        const int missing = y <= MISSING;  // the host wrote it in the place of what is no number
        lanes[lane] = missing ? 0.0 : y;
        present[lane] = missing ? 0.0 : 1.0;
      }
      const size_t where = VALUE(group, n_groups, n, s, c);
#if WIDTH == 1
      values[where] = lanes[0];
      if (weigh) weights[where] = present[0];
#else
      values[where] = PASTE(vload, WIDTH)(0, lanes);
      if (weigh) weights[where] = PASTE(vload, WIDTH)(0, present);
#endif
    }
  }
}

// The best node of the scan and the best one that is no neighbour of it. columns are
// [node][sample][N_COLUMNS], the same for all texels; grams [node][triangle of N_COLUMNS];
// solutions [node][state][N_D][N_D + 1] as `look_up` takes them.
kernel void scan_texels(const int n, global const real *values, global const real *weights,
                        const int n_nodes, global const number *columns,
                        global const number *grams, global const number *solutions,
                        global const number *nodes, global const number *spacing,
                        global real *found) {
  const int group = get_global_id(0), n_groups = get_global_size(0);
  real value[N_NODES];
  real total = (real)(0.0);
  for (int s = 0; s < n; ++s) {
    for (int c = 0; c < N_CHANNELS; ++c) {
      const size_t where = VALUE(group, n_groups, n, s, c);
#if WEIGHTED
      total += weights[where] * square(values[where]);
#else
      total += square(values[where]);
#endif
    }
  }
  for (int node = 0; node < n_nodes; ++node) {
    real rhs[N_CHANNELS][N_COLUMNS], gram[N_GRAMS][TRIANGLE(N_COLUMNS)];
    for (int c = 0; c < N_CHANNELS; ++c)
      for (int k = 0; k < N_COLUMNS; ++k) rhs[c][k] = (real)(0.0);
#if WEIGHTED
    for (int c = 0; c < N_GRAMS; ++c)
      for (int k = 0; k < TRIANGLE(N_COLUMNS); ++k) gram[c][k] = (real)(0.0);
#else
    for (int k = 0; k < TRIANGLE(N_COLUMNS); ++k) gram[0][k] = grams[node * TRIANGLE(N_COLUMNS) + k];
#endif
    global const number *column = columns + (size_t)node * n * N_COLUMNS;
    for (int s = 0; s < n; ++s, column += N_COLUMNS) {
      for (int c = 0; c < N_CHANNELS; ++c) {
        const size_t where = VALUE(group, n_groups, n, s, c);
#if WEIGHTED
        const real w = weights[where], wy = w * values[where];
        for (int k = 0; k < N_COLUMNS; ++k)
          for (int l = 0; l <= k; ++l) gram[c][AT_OR_BELOW(k, l)] += w * (column[k] * column[l]);
#else
        const real wy = values[where];
#endif
        for (int k = 0; k < N_COLUMNS; ++k) rhs[c][k] += wy * column[k];
      }
    }
    real lowest = total;
    for (int c = 0; c < N_CHANNELS; ++c) {
      const real *G = gram[WEIGHTED ? c : 0];
#if HAS_FIXED  // the last column has the coefficient 1
      lowest += G[AT_OR_BELOW(N_D, N_D)] - 2.0 * rhs[c][N_D];
      for (int k = 0; k < N_D; ++k) rhs[c][k] -= G[AT_OR_BELOW(N_D, k)];
#endif
#if WEIGHTED
      real none[N_D], move[N_D], is_free[N_D];
      for (int k = 0; k < N_D; ++k) none[k] = (real)(0.0);
      lowest -= solve_bounded(G, rhs[c], none, move, is_free);
#else
      lowest -= look_up(solutions + (size_t)node * N_STATES * N_D * (N_D + 1), G, rhs[c]);
#endif
    }
    value[node] = lowest;
  }
  real best[LEAST_ONE(N_T)], rival[LEAST_ONE(N_T)];
  real least = (real)(HUGE_NUMBER), second = (real)(HUGE_NUMBER);
  for (int node = 0; node < n_nodes; ++node) {
    const mask better = value[node] < least;
    least = WHERE(better, value[node], least);
    for (int j = 0; j < N_T; ++j)
      best[j] = WHERE(better, (real)(nodes[node * N_T + j]), best[j]);
  }
  for (int j = 0; j < N_T; ++j) rival[j] = best[j];
  for (int node = 0; node < n_nodes; ++node) {
    mask far = (real)(0.0) != (real)(0.0);
    for (int j = 0; j < N_T; ++j) far |= fabs(nodes[node * N_T + j] - best[j]) > 1.5 * spacing[j];
    const mask better = far & (value[node] < second);
    second = WHERE(better, value[node], second);
    for (int j = 0; j < N_T; ++j)
      rival[j] = WHERE(better, (real)(nodes[node * N_T + j]), rival[j]);
  }
  for (int j = 0; j < N_T; ++j) {
    found[ROW(j, group, n_groups)] = best[j];
    found[ROW(N_T + j, group, n_groups)] = rival[j];
  }
  // Rounding takes the value of a perfect fit to a little around 0.
  found[ROW(2 * N_T, group, n_groups)] = at_least(least, ROUNDING * total);
  found[ROW(2 * N_T + 1, group, n_groups)] = second;
}

// Thousands of surfaces at once: each lane of a `real` is one surface (a texel), all of them
// measured in the same directions. A formula's `scalar` is a vector here, so that every texel
// has nonlinear parameters of its own; what belongs to the directions is a plain number.
//
// f_c = FIXED + sum_d coordinate[c][d] column[d], columns made from the basis by the host's
// linear map; t are the searched parameters on their search scale. Nothing a lane computes
// depends on another lane, so a texel's result is the same whatever stands beside it.

#if WIDTH == 1
typedef int mask;
#define ANY(m) (m)
#elif PRECISION == 64
typedef VECTOR(long) mask;
#define ANY(m) any(m)
#else
typedef VECTOR(int) mask;
#define ANY(m) any(m)
#endif
#define WHERE(m, a, b) ((m) ? (a) : (b))

#define TRIANGLE(n) ((n) * ((n) + 1) / 2)
#define AT_OR_BELOW(i, j) ((i) * ((i) + 1) / 2 + (j))  // row i, column j <= i
#define ENTRY(i, j) ((i) >= (j) ? AT_OR_BELOW(i, j) : AT_OR_BELOW(j, i))
#define LEAST_ONE(n) ((n) > 0 ? (n) : 1)
#define N_COLUMNS (N_D + HAS_FIXED)
// Samples whose terms are added up before they join the total: sums of sums round less.
#define SAMPLES 32
#if WEIGHTED
#define N_GRAMS N_CHANNELS
#else
#define N_GRAMS 1
#endif
#if STRIDED  // neighbouring work-items read neighbouring numbers, as GPUs like it
#define VALUE(group, n_groups, n, s, c) ((size_t)((s) * N_CHANNELS + (c)) * (n_groups) + (group))
#else
#define VALUE(group, n_groups, n, s, c) (((size_t)(group) * (n) + (s)) * N_CHANNELS + (c))
#endif
// A result's row r of a work-item's lanes; the host reads [row][texel].
#define ROW(r, group, n_groups) ((size_t)(r) * (n_groups) + (group))

static inline geometry broadcast_geometry(global const number *planes, const int n, const int s) {
  geometry g;
  g.cos_theta_i = planes[s];
  g.cos_theta_o = planes[n + s];
  g.i_x = planes[2 * n + s];
  g.i_y = planes[3 * n + s];
  g.o_x = planes[4 * n + s];
  g.o_y = planes[5 * n + s];
  g.slope_x = planes[6 * n + s];
  g.slope_y = planes[7 * n + s];
  g.one_minus_cos_d = planes[8 * n + s];
  g.log2_cos_h = planes[9 * n + s];
  g.log2_cos_r = planes[10 * n + s];
  g.back_slope_x = planes[11 * n + s];
  g.back_slope_y = planes[12 * n + s];
  return g;
}

// Cholesky factor of G with the rows and columns of `in` = 0 replaced by the unit matrix's.
static inline void factorise(const real *G, const real *in, const int n, const scalar ridge,
                             real *L) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      real sum = G[AT_OR_BELOW(i, j)] * in[i] * in[j];
      if (i == j) sum += sum * ridge + (1.0 - in[i]);
      for (int k = 0; k < j; ++k) sum -= L[AT_OR_BELOW(i, k)] * L[AT_OR_BELOW(j, k)];
      // Stored inverted on the diagonal; a column that adds nothing new takes no part.
      if (i == j) {
        const real floor = TINY_PIVOT * (G[AT_OR_BELOW(i, i)] * in[i] + (1.0 - in[i]));
        const mask good = (sum > floor) & (sum > (real)(SMALLEST));
        L[AT_OR_BELOW(i, i)] = WHERE(good, rsqrt(WHERE(good, sum, (real)(1.0))), (real)(0.0));
      } else {
        L[AT_OR_BELOW(i, j)] = sum * L[AT_OR_BELOW(j, j)];
      }
    }
  }
}

static inline void substitute(const real *L, const int n, real *b) {
  for (int i = 0; i < n; ++i) {
    real sum = b[i];
    for (int k = 0; k < i; ++k) sum -= L[AT_OR_BELOW(i, k)] * b[k];
    b[i] = sum * L[AT_OR_BELOW(i, i)];
  }
  for (int i = n - 1; i >= 0; --i) {
    real sum = b[i];
    for (int k = i + 1; k < n; ++k) sum -= L[AT_OR_BELOW(k, i)] * b[k];
    b[i] = sum * L[AT_OR_BELOW(i, i)];
  }
}

// Minimise m G m / 2 - r m under low <= d + m <= high: the exact minimum, since every set of
// held coordinates is tried. Gives the move m, which coordinates are free, and what is gained,
// 2 r m - m G m.
static inline real solve_bounded(const real *G, const real *r, const real *d, real *move,
                                 real *is_free) {
  mask found = (mask)(0);
  real most = (real)(-HUGE_NUMBER);
  for (int k = 0; k < N_D; ++k) move[k] = is_free[k] = (real)(0.0);
  for (int state = 0; state < N_STATES; ++state) {
    real in[N_D], rest[N_D], held[N_D];
    int digits = state;
    for (int k = 0; k < N_D; ++k) {  // digit 0: free, 1: at its low, 2: at its high bound
      const int digit = digits % STATES_OF[k];
      digits /= STATES_OF[k];
      in[k] = digit == 0 ? (real)(1.0) : (real)(0.0);
      held[k] = digit == 0 ? (real)(0.0) : (digit == 1 ? LOW[k] : HIGH[k]) - d[k];
    }
    for (int k = 0; k < N_D; ++k) {
      real sum = r[k];
      for (int l = 0; l < N_D; ++l) sum -= G[ENTRY(k, l)] * held[l];
      rest[k] = sum * in[k];
    }
    real L[TRIANGLE(N_D)];
    factorise(G, in, N_D, RIDGE, L);
    substitute(L, N_D, rest);
    mask feasible = (real)(0.0) == (real)(0.0);
    real gain = (real)(0.0), trial[N_D];
    for (int k = 0; k < N_D; ++k) {
      trial[k] = rest[k] + held[k];
      const real slack = ROUNDING * (fabs(d[k]) + fabs(trial[k]));
      feasible &= (d[k] + trial[k] >= LOW[k] - slack) & (d[k] + trial[k] <= HIGH[k] + slack);
    }
    for (int k = 0; k < N_D; ++k) {
      real bent = (real)(0.0);
      for (int l = 0; l < N_D; ++l) bent += G[ENTRY(k, l)] * trial[l];
      gain += trial[k] * (2.0 * r[k] - bent);
    }
    const mask better = feasible & (gain > most) & !found;
    most = WHERE(better, gain, most);
    for (int k = 0; k < N_D; ++k) {
      const real inside = at_most(at_least(trial[k], LOW[k] - d[k]), HIGH[k] - d[k]);
      move[k] = WHERE(better, inside, move[k]);
      is_free[k] = WHERE(better, in[k], is_free[k]);
    }
    // Nothing held and nothing violated is the minimum; it is final, so that a texel's answer
    // does not depend on whether its neighbours need the other states.
    if (state == 0) {
      found = better;
      if (!ANY(!found)) break;
    }
  }
  return most;
}

#if !WEIGHTED
// The same from a table: where all texels share G, the move of each set of held coordinates is
// solution[k][.] (r, 1), which the host has worked out. Anchored at d = 0; gives what is gained.
static inline real look_up(global const number *solutions, const real *G, const real *r) {
  mask found = (mask)(0);
  real most = (real)(-HUGE_NUMBER);
  for (int state = 0; state < N_STATES; ++state) {
    mask feasible = (real)(0.0) == (real)(0.0);
    real gain = (real)(0.0), trial[N_D];
    for (int k = 0; k < N_D; ++k) {
      trial[k] = solutions[N_D];
      for (int l = 0; l < N_D; ++l) trial[k] += solutions[l] * r[l];
      solutions += N_D + 1;
      const real slack = ROUNDING * fabs(trial[k]);
      feasible &= (trial[k] >= LOW[k] - slack) & (trial[k] <= HIGH[k] + slack);
    }
    for (int k = 0; k < N_D; ++k) {
      real bent = (real)(0.0);
      for (int l = 0; l < N_D; ++l) bent += G[ENTRY(k, l)] * trial[l];
      gain += trial[k] * (2.0 * r[k] - bent);
    }
    const mask better = feasible & (gain > most) & !found;
    most = WHERE(better, gain, most);
    if (state == 0) {
      found = better;
      if (!ANY(!found)) break;
    }
  }
  return most;
}
#endif

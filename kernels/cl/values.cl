// Basis values at every direction, for several sets of nonlinear parameters.
// out[set][basis][direction vector]
kernel void basis_values(global const real *planes, const int n, global const scalar *x,
                         global real *out) {
  const int v = get_global_id(0), set = get_global_id(1);
  const constants c = prepare(x + set * N_X);
  real basis[N_BASIS];
  evaluate_row(planes, n, v, &c, basis);
  for (int k = 0; k < N_BASIS; ++k) out[(set * N_BASIS + k) * n + v] = basis[k];
}

// The basis functions of a row: along its direction, or averaged over several VIEWS of it, each
// with a weight of its own (kernels/views.py). The views' planes lie behind one another, the
// weight behind the others.
static inline void evaluate_row(global const real *planes, const int n, const int v,
                                const constants *c, real *basis) {
#ifdef VIEWS
  for (int k = 0; k < N_BASIS; ++k) basis[k] = 0.0;
  for (int view = 0; view < VIEWS; ++view) {
    global const real *own = planes + (size_t)view * (N_PLANES + 1) * n;
    const real weight = own[(size_t)N_PLANES * n + v];
    real part[N_BASIS];
    evaluate_basis(load_geometry(own, n, v), c, part);
    for (int k = 0; k < N_BASIS; ++k) basis[k] += weight * part[k];
  }
#else
  evaluate_basis(load_geometry(planes, n, v), c, basis);
#endif
}

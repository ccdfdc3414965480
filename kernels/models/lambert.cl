// Lambert: basis 1/pi.
typedef struct { int unused; } lambert_constants;

static inline lambert_constants lambert_prepare(const lambert_parameters p) {
  const lambert_constants c = {0};
  return c;
}

static inline void lambert_basis(const geometry g, const lambert_constants c, real *basis) {
  basis[0] = (real)(INV_PI);
}

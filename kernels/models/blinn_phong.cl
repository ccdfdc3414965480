// Blinn-Phong: basis (n + 2)/(8 pi) (n.h)^n.
typedef struct { scalar n, norm; } blinn_phong_constants;

static inline blinn_phong_constants blinn_phong_prepare(const blinn_phong_parameters p) {
  const blinn_phong_constants c = {p.n, 0.125 * INV_PI * (p.n + 2.0)};
  return c;
}

static inline void blinn_phong_basis(const geometry g, const blinn_phong_constants c, real *basis) {
  basis[0] = c.norm * exp2(c.n * g.log2_cos_h);
}

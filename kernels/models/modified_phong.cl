// Modified Phong: basis (n + 2)/(2 pi) (r.wo)^n.
typedef struct { scalar n, norm; } modified_phong_constants;

static inline modified_phong_constants modified_phong_prepare(const modified_phong_parameters p) {
  const modified_phong_constants c = {p.n, 0.5 * INV_PI * (p.n + 2.0)};
  return c;
}

static inline void modified_phong_basis(const geometry g, const modified_phong_constants c,
                                        real *basis) {
  basis[0] = c.norm * exp2(c.n * g.log2_cos_r);
}

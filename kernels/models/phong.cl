// Phong 1975, as a BRDF: basis (r.wo)^n / cos_theta_i.
typedef struct { scalar n; } phong_constants;

static inline phong_constants phong_prepare(const phong_parameters p) {
  const phong_constants c = {p.n};
  return c;
}

static inline void phong_basis(const geometry g, const phong_constants c, real *basis) {
  basis[0] = exp2(c.n * g.log2_cos_r) / g.cos_theta_i;
}

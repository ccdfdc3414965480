// Mirror seen through an aperture: basis 1/(Omega cos_theta_o) within the cone, else 0.
typedef struct { scalar log2_cos_edge, inv_solid_angle; } mirror_constants;

static inline mirror_constants mirror_prepare(const mirror_parameters p) {
  const scalar sin_half = sin(0.5 * p.aperture);
  const scalar half_versine = sin_half * sin_half;  // (1 - cos(aperture)) / 2
  const mirror_constants c = {M_LOG2E * log1p(-2.0 * half_versine),
                              0.25 * INV_PI / half_versine};
  return c;
}

static inline void mirror_basis(const geometry g, const mirror_constants c, real *basis) {
  // log2(r.wo) keeps its digits next to the mirror, where r.wo itself has none.
  basis[0] = g.log2_cos_r > c.log2_cos_edge ? c.inv_solid_angle / g.cos_theta_o : (real)(0.0);
}

// GGX: D Trowbridge-Reitz, Smith masking, F Schlick, over 4 cos_theta_i cos_theta_o.
// Bases (1 - s) B and s B, with coefficients k_s F0 and k_s.
typedef struct { scalar alpha; } ggx_constants;

static inline ggx_constants ggx_prepare(const ggx_parameters p) {
  const ggx_constants c = {p.alpha};
  return c;
}

static inline void ggx_basis(const geometry g, const ggx_constants c, real *basis) {
  const real divisor = PASTE(ggx_divisor_, OPTION_masking)(g, c.alpha);
  const real lobe = ggx_D_over(tan2_theta_h(g), c.alpha, divisor);
  const real s = schlick_weight(g);
  basis[0] = (1.0 - s) * lobe;
  basis[1] = s * lobe;
}

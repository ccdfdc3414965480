// ABC of Low et al. 2012 for smooth surfaces: basis (1 + B x^2)^(-C) F, x the distance of the
// projected directions from the mirror.
typedef struct { scalar B, C, eta; } abc_constants;

static inline abc_constants abc_prepare(const abc_parameters p) {
  const abc_constants c = {p.B, p.C, p.eta};
  return c;
}

static inline void abc_basis(const geometry g, const abc_constants c, real *basis) {
  const real x2 = projected_distance2(g);
  // 1 - |i_xy - o_xy|^2 / 4, which cancels at grazing incidence as it stands
  const real cos2 = 0.5 * (square(g.cos_theta_i) + square(g.cos_theta_o)) + 0.25 * x2;
  basis[0] = exp2(-c.C * positive_log2(1.0 + c.B * x2)) * fresnel_dielectric_F(1.0 - sqrt(cos2), c.eta);
}

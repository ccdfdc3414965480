// Oren & Nayar 1994, qualitative: basis (A + B max(i_xy.o_xy, 0) / max(cos_theta_i, cos_theta_o)) / pi.
typedef struct { scalar flat, back; } oren_nayar_constants;

static inline oren_nayar_constants oren_nayar_prepare(const oren_nayar_parameters p) {
  const scalar sigma2 = p.sigma * p.sigma;
  const oren_nayar_constants c = {INV_PI * (1.0 - 0.5 * sigma2 / (sigma2 + 0.33)),
                                  INV_PI * 0.45 * sigma2 / (sigma2 + 0.09)};
  return c;
}

static inline void oren_nayar_basis(const geometry g, const oren_nayar_constants c, real *basis) {
  const real backward = at_least(tangential_dot(g), 0.0) / at_least(g.cos_theta_i, g.cos_theta_o);
  basis[0] = c.flat + c.back * backward;
}

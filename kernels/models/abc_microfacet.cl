// ABC of Low et al. 2012 for microfacets: basis (1 + B (1 - n.h))^(-C) G F
//                                         / (cos_theta_i cos_theta_o).
typedef struct { scalar B, C, eta; } abc_microfacet_constants;

static inline abc_microfacet_constants abc_microfacet_prepare(const abc_microfacet_parameters p) {
  const abc_microfacet_constants c = {p.B, p.C, p.eta};
  return c;
}

static inline void abc_microfacet_basis(const geometry g, const abc_microfacet_constants c,
                                        real *basis) {
  const real t2 = tan2_theta_h(g);
  const real inv_cos_h = sqrt(1.0 + t2);
  // 1 - n.h, by way of the tangent: the difference itself has no digits near the mirror
  const real one_minus_cos_h = t2 / (inv_cos_h * (1.0 + inv_cos_h));
  basis[0] = exp2(-c.C * positive_log2(1.0 + c.B * one_minus_cos_h)) *
             fresnel_dielectric_F(g.one_minus_cos_d, c.eta) * 4.0 / v_cavity_divisor(g, t2);
}

// Masking and shadowing, as divisors: 4 cos_theta_i cos_theta_o / G, in which nothing cancels
// or overflows at grazing. A lobe that leaves its masking open calls
//   PASTE(divisor_, OPTION_masking)(g, t2, lambda_i, lambda_o)
// with Smith's Lambda of both directions, or, with Lambda = (root/cos - 1)/2 as for GGX,
//   PASTE(root_divisor_, OPTION_masking)(g, t2, root_i, root_o)
// t2 = tan^2(theta_h).

// Height-correlated Smith G = 1 / (1 + L_i + L_o); Heitz 2014, eq. 99.
static inline real divisor_smith_correlated(const geometry g, const real t2, const real lambda_i,
                                            const real lambda_o) {
  return 4.0 * g.cos_theta_i * g.cos_theta_o * (1.0 + lambda_i + lambda_o);
}
static inline real root_divisor_smith_correlated(const geometry g, const real t2,
                                                 const real root_i, const real root_o) {
  return 2.0 * (g.cos_theta_o * root_i + g.cos_theta_i * root_o);
}

// Separable Smith G = G1(i) G1(o), G1 = 1 / (1 + L); Walter et al. 2007, eq. 23.
static inline real divisor_smith_separable(const geometry g, const real t2, const real lambda_i,
                                           const real lambda_o) {
  return 4.0 * g.cos_theta_i * g.cos_theta_o * (1.0 + lambda_i) * (1.0 + lambda_o);
}
static inline real root_divisor_smith_separable(const geometry g, const real t2,
                                                const real root_i, const real root_o) {
  return (g.cos_theta_i + root_i) * (g.cos_theta_o + root_o);
}

// V-cavities, Torrance & Sparrow 1967; Cook & Torrance 1982: G = min(1, 2 n.h n.i / i.h,
// 2 n.h n.o / i.h) with n.h / i.h = 2 / (H_z (1 + t2)), which does not cancel at grazing.
static inline real v_cavity_divisor(const geometry g, const real t2) {
  const real H_z = g.cos_theta_i + g.cos_theta_o;
  return at_least(4.0 * g.cos_theta_i * g.cos_theta_o,
                  at_least(g.cos_theta_i, g.cos_theta_o) * H_z * (1.0 + t2));
}
static inline real divisor_v_cavity(const geometry g, const real t2, const real lambda_i,
                                    const real lambda_o) {
  return v_cavity_divisor(g, t2);
}
static inline real root_divisor_v_cavity(const geometry g, const real t2, const real root_i,
                                         const real root_o) {
  return v_cavity_divisor(g, t2);
}

// cos sqrt(1 + alpha^2 tan^2) of an isotropic GGX surface, finite at grazing.
static inline real ggx_root(const real cos_theta, const scalar alpha) {
  const scalar alpha2 = alpha * alpha;
  return positive_root(alpha2 + (1.0 - alpha2) * square(cos_theta));
}

// Smith's Lambda for Beckmann; Heitz 2014, eq. 72. alpha2_sin2 = (alpha sin(theta))^2.
// Where erf(a) - 1 loses its digits, Lambda is nothing beside the 1 it is added to: an
// absolute error of the rounding is enough. In single precision that allows a polynomial
// (Abramowitz & Stegun 1964, 7.1.26, 1.5e-7), several times as fast as erf.
static inline real beckmann_lambda(const real cos_theta, const real alpha2_sin2) {
  const real a = cos_theta * rsqrt(at_least(alpha2_sin2, 1e-28));
#if PRECISION == 32
  const real t = 1.0 / (1.0 + 0.3275911 * a);
  const real p = -1.453152027 + t * 1.061405429;
  const real erfc_over_exp =
      t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * p)));
  return exp(-square(a)) * (0.28209479177387814 / a - 0.5 * erfc_over_exp);
#else
  return 0.5 * (erf(a) - 1.0) + 0.28209479177387814 * exp(-square(a)) / a;
#endif
}

// The pieces of a microfacet lobe B = D G / (4 cos_theta_i cos_theta_o).
// D is normalised so that the integral of D cos_theta_h over the hemisphere is 1.

// Beckmann & Spizzichino 1963; Walter et al. 2007, eq. 25. t2 = tan^2(theta_h).
static inline real beckmann_D(const real t2, const scalar alpha) {
  const scalar inv_alpha2 = 1.0 / (alpha * alpha);
  return INV_PI * inv_alpha2 * square(1.0 + t2) * exp(-t2 * inv_alpha2);
}

// Trowbridge & Reitz 1975; Walter et al. 2007, eq. 33, over alpha^2 + tan^2(theta_h):
// D / divisor, in one division for two.
static inline real ggx_D_over(const real t2, const scalar alpha, const real divisor) {
  return INV_PI * square(alpha * (1.0 + t2)) / (square(alpha * alpha + t2) * divisor);
}

// V-cavities, Torrance & Sparrow 1967; Cook & Torrance 1982.
// cos_theta_h / cos_theta_d = 2 / (H_z (1 + tan^2 theta_h)), which does not cancel at grazing.
static inline real v_cavity_G(const geometry g, const real t2) {
  const real H_z = g.cos_theta_i + g.cos_theta_o;
  return fmin(1.0, 4.0 * fmin(g.cos_theta_i, g.cos_theta_o) / (H_z * (1.0 + t2)));
}

// sqrt(alpha^2 + (1 - alpha^2) cos^2) = cos sqrt(1 + alpha^2 tan^2), finite at grazing.
static inline real ggx_smith_root(const real cos_theta, const scalar alpha) {
  const scalar alpha2 = alpha * alpha;
  return sqrt(alpha2 + (1.0 - alpha2) * square(cos_theta));
}

// 4 cos_theta_i cos_theta_o over height-correlated Smith G; Heitz 2014, eq. 99.
static inline real ggx_divisor_smith_correlated(const geometry g, const scalar alpha) {
  return 2.0 * (g.cos_theta_o * ggx_smith_root(g.cos_theta_i, alpha) +
                g.cos_theta_i * ggx_smith_root(g.cos_theta_o, alpha));
}

// 4 cos_theta_i cos_theta_o over separable Smith G; Walter et al. 2007, eq. 23 and 34.
static inline real ggx_divisor_smith_separable(const geometry g, const scalar alpha) {
  return (g.cos_theta_i + ggx_smith_root(g.cos_theta_i, alpha)) *
         (g.cos_theta_o + ggx_smith_root(g.cos_theta_o, alpha));
}

// Weight of white in Schlick's Fresnel term: F = F0 (1 - s) + s. Schlick 1994, eq. 15.
static inline real schlick_weight(const geometry g) {
  const real m = g.one_minus_cos_d;
  return square(square(m)) * m;
}

// Ashikhmin & Shirley 2000, n = 2/alpha^2: the diffuse basis, then the Fresnel term's of the lobe
// B = sqrt((n_x+1)(n_y+1))/(8 pi) cos_theta_h^(n_x cos^2 phi_h + n_y sin^2 phi_h)
//     / (cos_theta_d max(cos_theta_i, cos_theta_o)).
typedef struct {
  roughness_axes axes;
  scalar norm;
  fresnel_constants fresnel;
} ashikhmin_shirley_constants;

static inline ashikhmin_shirley_constants ashikhmin_shirley_prepare(
    const ashikhmin_shirley_parameters p) {
  const scalar n_x = 2.0 / (p.alpha_x * p.alpha_x), n_y = 2.0 / (p.alpha_y * p.alpha_y);
  const ashikhmin_shirley_constants c = {
      roughness_along(p.phi_x, p.alpha_x, p.alpha_y),
      0.125 * INV_PI * sqrt(n_x + 1.0) * sqrt(n_y + 1.0),
      PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

// 1 - (1 - x)^5, multiplied out: small x keeps its digits.
static inline real ashikhmin_shirley_fill(const real x) {
  return x * (5.0 + x * (-10.0 + x * (10.0 + x * (-5.0 + x))));
}

static inline void ashikhmin_shirley_basis(const geometry g, const ashikhmin_shirley_constants c,
                                           real *basis) {
  const real t2 = tan2_theta_h(g);
  // At the mirror both slope and logarithm vanish; their ratio is finite.
  const real exponent = 2.0 * slope_over_alpha2(g, c.axes) * (g.log2_cos_h / at_least(t2, 1e-30));
  // cos_theta_d = (cos_theta_i + cos_theta_o)/(2 cos_theta_h) keeps its digits at grazing.
  const real cos_d = 0.5 * (g.cos_theta_i + g.cos_theta_o) * sqrt(1.0 + t2);
  const real lobe = c.norm * exp2(exponent) / (cos_d * at_least(g.cos_theta_i, g.cos_theta_o));
  basis[0] = 28.0 / 23.0 * INV_PI * (ashikhmin_shirley_fill(0.5 * g.cos_theta_i) *
                                     ashikhmin_shirley_fill(0.5 * g.cos_theta_o));
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis + 1);
}

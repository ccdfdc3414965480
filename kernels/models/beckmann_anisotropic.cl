// Beckmann's distribution with two roughnesses; masking and Fresnel term are options.
typedef struct { roughness_axes axes; fresnel_constants fresnel; } beckmann_anisotropic_constants;

static inline beckmann_anisotropic_constants beckmann_anisotropic_prepare(const beckmann_anisotropic_parameters p) {
  const beckmann_anisotropic_constants c = {roughness_along(p.phi_x, p.alpha_x, p.alpha_y), PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void beckmann_anisotropic_basis(const geometry g, const beckmann_anisotropic_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real divisor = PASTE(divisor_, OPTION_masking)(
      g, t2, beckmann_lambda(g.cos_theta_i, alpha2_sin2(g.i_x, g.i_y, c.axes)),
      beckmann_lambda(g.cos_theta_o, alpha2_sin2(g.o_x, g.o_y, c.axes)));
  const scalar widths = PI * c.axes.alpha_x * c.axes.alpha_y;
  const real lobe = square(1.0 + t2) * exp(-slope_over_alpha2(g, c.axes)) / (widths * divisor);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

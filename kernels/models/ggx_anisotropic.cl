// GGX with two roughnesses; masking and Fresnel term are the record's options.
typedef struct { roughness_axes axes; fresnel_constants fresnel; } ggx_anisotropic_constants;

static inline ggx_anisotropic_constants ggx_anisotropic_prepare(const ggx_anisotropic_parameters p) {
  const ggx_anisotropic_constants c = {roughness_along(p.phi_x, p.alpha_x, p.alpha_y), PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void ggx_anisotropic_basis(const geometry g, const ggx_anisotropic_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real root_i = positive_root(square(g.cos_theta_i) + alpha2_sin2(g.i_x, g.i_y, c.axes));
  const real root_o = positive_root(square(g.cos_theta_o) + alpha2_sin2(g.o_x, g.o_y, c.axes));
  const real divisor = PASTE(root_divisor_, OPTION_masking)(g, t2, root_i, root_o);
  const real widths = PI * c.axes.alpha_x * c.axes.alpha_y;
  const real lobe = square((1.0 + t2) / (1.0 + slope_over_alpha2(g, c.axes))) / (widths * divisor);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

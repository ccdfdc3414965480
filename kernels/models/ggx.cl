// GGX: the Trowbridge-Reitz distribution; masking and Fresnel term are the record's options.
typedef struct { scalar alpha; fresnel_constants fresnel; } ggx_constants;

static inline ggx_constants ggx_prepare(const ggx_parameters p) {
  const ggx_constants c = {p.alpha, PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void ggx_basis(const geometry g, const ggx_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real divisor = PASTE(root_divisor_, OPTION_masking)(
      g, t2, ggx_root(g.cos_theta_i, c.alpha), ggx_root(g.cos_theta_o, c.alpha));
  const real lobe = ggx_D_over(t2, c.alpha, divisor);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

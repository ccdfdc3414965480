// Beckmann's distribution; masking and Fresnel term are the record's options.
typedef struct { scalar alpha; fresnel_constants fresnel; } beckmann_constants;

static inline beckmann_constants beckmann_prepare(const beckmann_parameters p) {
  const beckmann_constants c = {p.alpha, PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void beckmann_basis(const geometry g, const beckmann_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const scalar alpha2 = c.alpha * c.alpha;
  const real divisor = PASTE(divisor_, OPTION_masking)(
      g, t2, beckmann_lambda(g.cos_theta_i, alpha2 * (square(g.i_x) + square(g.i_y))),
      beckmann_lambda(g.cos_theta_o, alpha2 * (square(g.o_x) + square(g.o_y))));
  const real lobe = beckmann_D(t2, c.alpha) / divisor;
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

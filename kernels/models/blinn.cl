// Blinn's cosine power of the facet angle, V-cavities; the Fresnel term is an option.
typedef struct { scalar n, norm; fresnel_constants fresnel; } blinn_constants;

static inline blinn_constants blinn_prepare(const blinn_parameters p) {
  const blinn_constants c = {p.n, 0.5 * INV_PI * (p.n + 2.0),
                             PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void blinn_basis(const geometry g, const blinn_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real lobe = c.norm * exp2(c.n * g.log2_cos_h) / v_cavity_divisor(g, t2);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

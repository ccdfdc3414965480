// Generalised Trowbridge-Reitz, V-cavities; the Fresnel term is an option.
typedef struct { scalar inv_alpha2, gamma, norm; fresnel_constants fresnel; } gtr_constants;

static inline gtr_constants gtr_prepare(const gtr_parameters p) {
  const gtr_constants c = {1.0 / (p.alpha * p.alpha), p.gamma, gtr_norm(p.alpha, p.gamma),
                           PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void gtr_basis(const geometry g, const gtr_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real lobe = gtr_D(t2, c.inv_alpha2, c.gamma, c.norm) / v_cavity_divisor(g, t2);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

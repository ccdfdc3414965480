// Cook-Torrance: Beckmann's distribution, V-cavities; the Fresnel term is an option.
typedef struct { scalar alpha; fresnel_constants fresnel; } cook_torrance_constants;

static inline cook_torrance_constants cook_torrance_prepare(const cook_torrance_parameters p) {
  const cook_torrance_constants c = {p.alpha, PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void cook_torrance_basis(const geometry g, const cook_torrance_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real lobe = beckmann_D(t2, c.alpha) / v_cavity_divisor(g, t2);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

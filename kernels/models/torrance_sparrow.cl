// Torrance-Sparrow: a Gaussian of the facet angle, V-cavities; the Fresnel term is an option.
typedef struct { scalar inv_alpha2, norm; fresnel_constants fresnel; } torrance_sparrow_constants;

static inline torrance_sparrow_constants torrance_sparrow_prepare(
    const torrance_sparrow_parameters p) {
  const torrance_sparrow_constants c = {1.0 / (p.alpha * p.alpha), torrance_sparrow_norm(p.alpha),
                                        PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void torrance_sparrow_basis(const geometry g, const torrance_sparrow_constants c,
                                          real *basis) {
  const real t2 = tan2_theta_h(g);
  const real lobe = torrance_sparrow_D(t2, c.inv_alpha2, c.norm) / v_cavity_divisor(g, t2);
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

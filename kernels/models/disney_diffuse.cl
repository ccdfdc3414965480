// Burley 2012, diffuse: basis (1 + e (1 - cos_theta_i)^5) (1 + e (1 - cos_theta_o)^5) / pi,
// e = 2 roughness cos^2(theta_d) - 1/2.
typedef struct { scalar twice_roughness; } disney_diffuse_constants;

static inline disney_diffuse_constants disney_diffuse_prepare(const disney_diffuse_parameters p) {
  const disney_diffuse_constants c = {2.0 * p.roughness};
  return c;
}

static inline real disney_diffuse_edge(const real cos_theta, const real gain) {
  const real m = 1.0 - cos_theta;
  return 1.0 + gain * square(square(m)) * m;
}

static inline void disney_diffuse_basis(const geometry g, const disney_diffuse_constants c,
                                        real *basis) {
  const real gain = c.twice_roughness * square(1.0 - g.one_minus_cos_d) - 0.5;
  basis[0] = INV_PI * (disney_diffuse_edge(g.cos_theta_i, gain) *
                       disney_diffuse_edge(g.cos_theta_o, gain));
}

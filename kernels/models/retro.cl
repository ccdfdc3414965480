// Retro-reflection: GGX of the back vector, height-correlated Smith, over
// 4 cos_theta_i cos_theta_o.
typedef struct { scalar alpha; } retro_constants;

static inline retro_constants retro_prepare(const retro_parameters p) {
  const retro_constants c = {p.alpha};
  return c;
}

static inline void retro_basis(const geometry g, const retro_constants c, real *basis) {
  const real t2 = square(g.back_slope_x) + square(g.back_slope_y);
  const real divisor = root_divisor_smith_correlated(g, t2, ggx_root(g.cos_theta_i, c.alpha),
                                                     ggx_root(g.cos_theta_o, c.alpha));
  basis[0] = ggx_D_over(t2, c.alpha, divisor);
}

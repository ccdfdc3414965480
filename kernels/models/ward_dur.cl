// Ward-Dur 2006: basis exp(-(slope along x/alpha_x)^2 - (slope along y/alpha_y)^2)
//                      / (4 pi alpha_x alpha_y cos_theta_i cos_theta_o).
typedef struct { ward_axes axes; scalar norm; } ward_dur_constants;

static inline ward_dur_constants ward_dur_prepare(const ward_dur_parameters p) {
  const ward_dur_constants c = {ward_axes_of(p.alpha_x, p.alpha_y, p.phi_x),
                                0.25 * INV_PI / (p.alpha_x * p.alpha_y)};
  return c;
}

static inline void ward_dur_basis(const geometry g, const ward_dur_constants c, real *basis) {
  basis[0] = c.norm * ward_gaussian(g, c.axes) / (g.cos_theta_i * g.cos_theta_o);
}

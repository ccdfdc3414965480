// Ward 1992: basis exp(-(slope along x/alpha_x)^2 - (slope along y/alpha_y)^2)
//                  / (4 pi alpha_x alpha_y sqrt(cos_theta_i cos_theta_o)).
typedef struct { scalar cos_x, sin_x, inv_alpha_x, inv_alpha_y, norm; } ward_constants;

static inline ward_constants ward_prepare(const ward_parameters p) {
  const ward_constants c = {cos(p.phi_x), sin(p.phi_x), 1.0 / p.alpha_x, 1.0 / p.alpha_y,
                            0.25 * INV_PI / (p.alpha_x * p.alpha_y)};
  return c;
}

static inline void ward_basis(const geometry g, const ward_constants c, real *basis) {
  const real along_x = (c.cos_x * g.slope_x + c.sin_x * g.slope_y) * c.inv_alpha_x;
  const real along_y = (c.cos_x * g.slope_y - c.sin_x * g.slope_x) * c.inv_alpha_y;
  basis[0] = c.norm * exp(-square(along_x) - square(along_y)) *
             rsqrt(g.cos_theta_i * g.cos_theta_o);
}

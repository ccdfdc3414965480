// What the models of Ward's family share: a Gaussian of the half vector's slope along two axes.
typedef struct { scalar cos_x, sin_x, inv_alpha_x, inv_alpha_y; } ward_axes;

static inline ward_axes ward_axes_of(const scalar alpha_x, const scalar alpha_y,
                                     const scalar phi_x) {
  const ward_axes a = {cos(phi_x), sin(phi_x), 1.0 / alpha_x, 1.0 / alpha_y};
  return a;
}

static inline real ward_gaussian(const geometry g, const ward_axes a) {
  const real along_x = (a.cos_x * g.slope_x + a.sin_x * g.slope_y) * a.inv_alpha_x;
  const real along_y = (a.cos_x * g.slope_y - a.sin_x * g.slope_x) * a.inv_alpha_y;
  return exp(-square(along_x) - square(along_y));
}

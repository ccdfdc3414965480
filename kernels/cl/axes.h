// Two roughnesses along axes at the azimuth phi_x, for the anisotropic lobes.
typedef struct { scalar cos_x, sin_x, alpha_x, alpha_y; } roughness_axes;

static inline roughness_axes roughness_along(const scalar phi_x, const scalar alpha_x,
                                             const scalar alpha_y) {
  const roughness_axes a = {cos(phi_x), sin(phi_x), alpha_x, alpha_y};
  return a;
}

// (slope along x / alpha_x)^2 + (slope along y / alpha_y)^2 of the half vector
static inline real slope_over_alpha2(const geometry g, const roughness_axes a) {
  return square((a.cos_x * g.slope_x + a.sin_x * g.slope_y) / a.alpha_x) +
         square((a.cos_x * g.slope_y - a.sin_x * g.slope_x) / a.alpha_y);
}

// (alpha sin(theta))^2 of a direction with tangential components x and y, alpha along it
static inline real alpha2_sin2(const real x, const real y, const roughness_axes a) {
  return square((a.cos_x * x + a.sin_x * y) * a.alpha_x) +
         square((a.cos_x * y - a.sin_x * x) * a.alpha_y);
}

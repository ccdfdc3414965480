// Distributions of microfacet normals, normalised so that the integral of D cos_theta_h over
// the hemisphere is 1. t2 = tan^2(theta_h).

// Beckmann & Spizzichino 1963; Walter et al. 2007, eq. 25.
static inline real beckmann_D(const real t2, const scalar alpha) {
  const scalar inv_alpha2 = 1.0 / (alpha * alpha);
  return INV_PI * inv_alpha2 * square(1.0 + t2) * exp(-t2 * inv_alpha2);
}

// Trowbridge & Reitz 1975; Walter et al. 2007, eq. 33: D / divisor, in one division for two.
static inline real ggx_D_over(const real t2, const scalar alpha, const real divisor) {
  return INV_PI * square(alpha * (1.0 + t2)) / (square(alpha * alpha + t2) * divisor);
}

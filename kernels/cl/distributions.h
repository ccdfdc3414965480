// Distributions of microfacet normals, normalised so that the integral of D cos_theta_h over
// the hemisphere is 1. t2 = tan^2(theta_h).

// Beckmann & Spizzichino 1963; Walter et al. 2007, eq. 25.
static inline real beckmann_D(const real t2, const scalar alpha) {
  const scalar inv_alpha2 = 1.0 / (alpha * alpha);
  // 2^x is faster than e^x.
  return INV_PI * inv_alpha2 * square(1.0 + t2) * exp2(-t2 * (inv_alpha2 * LOG2_E));
}

// Trowbridge & Reitz 1975; Walter et al. 2007, eq. 33: D / divisor, in one division for two.
static inline real ggx_D_over(const real t2, const scalar alpha, const real divisor) {
  return INV_PI * square(alpha * (1.0 + t2)) / (square(alpha * alpha + t2) * divisor);
}

// Generalised Trowbridge & Reitz; Burley 2012, appendix B, in a form that passes gamma = 1 and
// alpha = 1: with z = (gamma - 1) |ln alpha^2|,
//   D = -expm1(-|ln alpha^2|)/|ln alpha^2| z/(1 - e^-z) ((1 + t2)/(1 + t2/alpha^2))^gamma
//       / (pi alpha^2).
// All of it that is the same for every direction:
static inline scalar gtr_norm(const scalar alpha, const scalar gamma) {
  const scalar log_alpha2 = 2.0 * log(alpha);
  const scalar z = (1.0 - gamma) * log_alpha2;
  const scalar wide = fabs(log_alpha2) < 1e-30 ? 1.0 : expm1(log_alpha2) / log_alpha2;
  const scalar steep = fabs(z) < 1e-30 ? 1.0 : -z / expm1(-z);
  return INV_PI * wide * steep / (alpha * alpha);
}
static inline real gtr_D(const real t2, const scalar inv_alpha2, const scalar gamma,
                         const scalar norm) {
  return norm * exp2(gamma * positive_log2((1.0 + t2) / (1.0 + t2 * inv_alpha2)));
}

// Student's t distribution of slopes; Ribardiere et al. 2017. scale2 = (gamma - 1) alpha^2.
static inline real student_t_D(const real t2, const scalar scale2, const scalar gamma) {
  return INV_PI * (gamma - 1.0) / scale2 * square(1.0 + t2) *
         exp2(-gamma * positive_log2(1.0 + t2 / scale2));
}

// Gaussian of the facet angle itself; Torrance & Sparrow 1967, normalised here.
// 1/norm = pi alpha * integral of exp(-u^2) sin(2 alpha u), theta_h = alpha u up to 90 degrees
// or 6 widths. Gauss-Legendre with 22 nodes, 2e-15 of the value for alpha up to 2; the nodes
// come in pairs about the middle.
constant scalar gauss_node[11] = {
    0.069739273319722221, 0.20786042668822129, 0.34193582089208423, 0.46935583798675703,
    0.58764040350691159, 0.69448726318668278, 0.78781680597920816, 0.86581257772030014,
    0.92695677218717400, 0.97006049783542873, 0.99429458548239929};
constant scalar gauss_weight[11] = {
    0.13925187285563199, 0.13654149834601517, 0.13117350478706237, 0.12325237681051242,
    0.11293229608053922, 0.10041414444288096, 0.085941606217067727, 0.069796468424520488,
    0.052293335152683286, 0.033774901584814155, 0.014627995298272201};
static inline scalar torrance_sparrow_norm(const scalar alpha) {
  const scalar half_range = fmin(0.25 * PI / alpha, (scalar)(3.0));
  scalar sum = 0.0;
  for (int k = 0; k < 11; ++k) {
    const scalar low = half_range * (1.0 - gauss_node[k]);
    const scalar high = half_range * (1.0 + gauss_node[k]);
    sum += gauss_weight[k] * (exp(-low * low) * sin(2.0 * alpha * low) +
                              exp(-high * high) * sin(2.0 * alpha * high));
  }
  return INV_PI / (alpha * half_range * sum);
}
static inline real torrance_sparrow_D(const real t2, const scalar inv_alpha2, const scalar norm) {
  return norm * exp(-square(atan(sqrt(t2))) * inv_alpha2);
}

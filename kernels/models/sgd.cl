// Shifted gamma distribution, Bagher, Soler & Holzschuch 2012: F D G1(i) G1(o) / (pi n_i n_o).
// D = K e^-x / (pi x^p cos^4), x = alpha + t2/alpha, is written as
//   e^(-t2/alpha) (1 + t2/alpha^2)^-p (1 + t2)^2 / (pi alpha S),
// S = alpha^p e^alpha Gamma(1 - p, alpha), where nothing overflows.
typedef struct {
  scalar F0, F_g, inv_alpha, inv_alpha2, p, norm;  // D and the Fresnel factor
  scalar Lambda_1, L, k_g, inv_range;              // masking
} sgd_constants;

// (1/Gamma(1 + b) - 1)/b for |b| <= 1/2, its Taylor series.
static inline double sgd_reciprocal_gamma(const double b) {
  const double c[] = {
      0.57721566490153286, -0.65587807152025388, -0.042002635034095236, 0.16653861138229149,
      -0.042197734555544337, -0.0096219715278769736, 0.0072189432466630995, -0.0011651675918590651,
      -0.00021524167411495097, 0.00012805028238811619, -2.0134854780788239e-5, -1.2504934821426707e-6,
      1.1330272319816959e-6, -2.0563384169776071e-7, 6.1160951044814158e-9, 5.0020076444692229e-9,
      -1.1812745704870201e-9, 1.0434267116911005e-10, 7.7822634399050713e-12};
  double sum = 0.0;
  for (int n = sizeof(c) / sizeof(c[0]) - 1; n >= 0; --n) sum = sum * b + c[n];
  return sum;
}

// alpha^p e^alpha Gamma(1 - p, alpha) for 0 <= p <= 2 and alpha up to 2, by the power series of
// Gamma(u, alpha). At u = 0 its first two terms, Gamma(u) and alpha^u/u, are both infinite:
// taken together as differences from 1/u they keep their digits. Below u = -1/2 the recurrence
// from u + 1 takes over.
static inline double sgd_scaled_gamma(const double p, const double alpha) {
  const double a = 1.0 - p, log_alpha = log(alpha);
  const double b = a > 0.5 ? a - 1.0 : (a < -0.5 ? a + 1.0 : a);
  const double not_0 = fabs(b) < 1e-30 ? 1e-30 : b;
  const double u = a > 0.5 ? a : b;
  const double h = sgd_reciprocal_gamma(b), gamma_1_b = 1.0 / (1.0 + b * h);
  const double head = a > 0.5 ? gamma_1_b - exp(a * log_alpha) / a
                              : -h * gamma_1_b - expm1(not_0 * log_alpha) / not_0;
  double term = 1.0, sum = 0.0;
  for (int n = 1; n <= 26; ++n) {  // 2^26/26! = 2e-19
    term *= -alpha / n;
    sum += term / (u + n);
  }
  const double upper = head - exp(u * log_alpha) * sum;
  const double wanted = a < -0.5 ? (exp(a * log_alpha - alpha) - upper) / -a : upper;
  return exp(alpha + p * log_alpha) * wanted;
}

static inline sgd_constants sgd_prepare(const sgd_parameters p) {
  const scalar S = sgd_scaled_gamma(p.p, p.alpha);
  const scalar inv_alpha = 1.0 / p.alpha;
  const sgd_constants c = {p.F0, p.F_g, inv_alpha, inv_alpha * inv_alpha, p.p,
                           INV_PI * INV_PI * inv_alpha / S,
                           1.0 + p.Lambda, log1p(1.0 / p.Lambda), p.k_g,
                           1.0 / (0.5 * PI - p.theta0)};
  return c;
}

// 1 + Lambda - Lambda e^(L r^k) = (1 + Lambda)(1 - e^(-L (1 - r^k))), with 1 - r from the
// elevation above the horizon: exact at grazing, where it goes to 0. Below theta0 r = 0.
static inline real sgd_G1(const real cos_theta, const real x, const real y,
                          const sgd_constants c) {
  const real elevation = atan2(cos_theta, sqrt(square(x) + square(y)));
  const real one_minus_r = at_most(elevation * c.inv_range, 0.9999999);
  const real rest = -expm1(c.k_g * log1p(-one_minus_r));
  return -c.Lambda_1 * expm1(-c.L * rest);
}

static inline void sgd_basis(const geometry g, const sgd_constants c, real *basis) {
  // Beyond 1e4 D is 0 for every alpha up to 2, and its factors, in whatever order they are
  // multiplied, overflow in single precision.
  const real t2 = at_most(tan2_theta_h(g), 1e4), m = g.one_minus_cos_d;
  const real m5 = square(square(m)) * m;
  const real F = c.F0 * (1.0 - m) + c.F_g * (m - m5) + m5;
  const real D = exp(-t2 * c.inv_alpha) * exp2(-c.p * positive_log2(1.0 + t2 * c.inv_alpha2)) *
                 square(1.0 + t2);
  const real G = sgd_G1(g.cos_theta_i, g.i_x, g.i_y, c) * sgd_G1(g.cos_theta_o, g.o_x, g.o_y, c);
  basis[0] = c.norm * F * D * G / (g.cos_theta_i * g.cos_theta_o);
}

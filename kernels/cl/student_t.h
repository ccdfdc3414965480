// Smith's Lambda for Student's t distribution of slopes (distributions.h). With mu the
// cotangent of the direction and P the distribution of slopes along it,
//   Lambda = (1/mu) * integral of (q - mu) P(q) over q > mu,
//   P(q) = Gamma(a + 1/2) / (sqrt(pi) Gamma(a) s) (1 + q^2/s^2)^-(a + 1/2),
// a = gamma - 1 and s^2 = a alpha^2. The integral of q P closes; that of P is Student's tail
// I_w(a, a), I the incomplete beta function and w = (1 - mu/sqrt(mu^2 + s^2))/2. w is at most
// 1/2, where the continued fraction of DiDonato & Morris 1992 converges fast for every
// a up to 39: measured, Lambda is right to 1e-14 of 1 + Lambda in double, 1.1e-6 in single.
#if PRECISION == 64
#define STUDENT_T_STEPS 16
#else
#define STUDENT_T_STEPS 10
#endif

// The fraction is a (1 + slope[0] w + rise[0] w^2 / (1 + slope[1] w + rise[1] w^2 / (...))).
typedef struct {
  scalar a, scale2, norm;
  scalar slope[STUDENT_T_STEPS + 1], rise[STUDENT_T_STEPS];
} student_t_masking;

static inline student_t_masking student_t_masking_for(const scalar alpha, const scalar gamma) {
  student_t_masking c;
  const scalar a = gamma - 1.0;
  c.a = a;
  c.scale2 = a * alpha * alpha;
  c.slope[0] = -2.0 * a / (a + 1.0);
  for (int k = 1; k <= STUDENT_T_STEPS; ++k) {
    const scalar m = k, here = a + 2.0 * m;
    const scalar below = here - 1.0, above = here + 1.0;
    c.slope[k] = (m * (a - m) / below - (a + m) * (2.0 * a + m) / above) / here;
    c.rise[k - 1] = (a + m - 1.0) * (2.0 * a + m - 1.0) * m * (a - m) /
                    (below * below * here * (here - 2.0));
  }
  // Half of all slopes are positive: the tail at w = 1/2 is 1/2, which gives the factor
  // Gamma(a + 1/2) / (sqrt(pi) Gamma(a)) as the fraction there.
  scalar fraction = 1.0 + 0.5 * c.slope[STUDENT_T_STEPS];
  for (int k = STUDENT_T_STEPS - 1; k >= 0; --k)
    fraction = 1.0 + 0.5 * c.slope[k] + 0.25 * c.rise[k] / fraction;
  c.norm = a * fraction;
  return c;
}

static inline real student_t_lambda(const real cos_theta, const real sin2_theta,
                                    const student_t_masking c) {
  const real spread2 = at_least(c.scale2 * sin2_theta, 1e-30);
  const real cos2 = square(cos_theta);
  const real root = sqrt(cos2 + spread2);
  const real w = 0.5 * spread2 / (root * (root + cos_theta));
  const real w2 = square(w);
  real fraction = 1.0 + c.slope[STUDENT_T_STEPS] * w;
  for (int k = STUDENT_T_STEPS - 1; k >= 0; --k)
    fraction = 1.0 + c.slope[k] * w + c.rise[k] * w2 / fraction;
  const real power = exp2(-c.a * log2_1p(cos2 / spread2));
  return c.norm * power * (root / ((2.0 * c.a - 1.0) * cos_theta) - 0.5 / (c.a * fraction));
}

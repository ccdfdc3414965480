// Fresnel terms. A lobe that leaves its Fresnel term open calls
//   PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis)
// which writes the basis functions lobe x (factors of F), in the order of the record's
// factors; c.fresnel = PASTE(fresnel_constants_, OPTION_fresnel)(p).
typedef struct { scalar a, b; } fresnel_constants;
#define fresnel_constants_none(p) {0.0, 0.0}
#define fresnel_constants_schlick(p) {0.0, 0.0}
#define fresnel_constants_dielectric(p) {(p).eta, 0.0}
#define fresnel_constants_conductor(p) {(p).eta, (p).k}
#define fresnel_constants_f82(p) {(p).F0, (p).F82}

// Weight of white in Schlick's term: F = F0 (1 - s) + s. Schlick 1994, eq. 15.
static inline real schlick_weight(const geometry g) {
  const real m = g.one_minus_cos_d;
  return square(square(m)) * m;
}

// Unpolarised reflectance of a smooth dielectric of relative index eta >= 1, where the
// angle of incidence has the cosine 1 - one_minus_cos_d. Fresnel's r_s and r_p with the
// difference of the two cosines taken out: r = (eta^2 - 1) (...) / (sum)^2, so that an index
// close to 1 and grazing incidence keep their digits.
static inline real fresnel_dielectric_F(const real one_minus_cos_d, const scalar eta) {
  const scalar eta2 = eta * eta, eta2_minus_1 = (eta - 1.0) * (eta + 1.0);
  const real c = 1.0 - one_minus_cos_d;
  const real refracted = sqrt(eta2_minus_1 + square(c));  // eta times the refracted cosine
  const real r_s = eta2_minus_1 / square(refracted + c);
  const real r_p = eta2_minus_1 * ((eta2 + 1.0) * square(c) - 1.0) / square(eta2 * c + refracted);
  return 0.5 * (square(r_s) + square(r_p));
}

// Unpolarised reflectance of a smooth conductor of index eta + i k: the refracted cosine
// times the index is a + i b, taken from the larger of a and b so that neither cancels.
static inline real fresnel_conductor_F(const real one_minus_cos_d, const scalar eta,
                                       const scalar k) {
  const real c = 1.0 - one_minus_cos_d;
  const real s2 = one_minus_cos_d * (2.0 - one_minus_cos_d);
  const scalar eta_k = eta * k;
  const real difference = (eta - k) * (eta + k) - s2;  // a^2 - b^2
  const real sum = sqrt(square(difference) + 4.0 * eta_k * eta_k);
  const real larger = sqrt(at_least(0.5 * (sum + fabs(difference)), 1e-30));
  const real smaller = eta_k / larger;
  const real a = difference > 0.0 ? larger : smaller;
  const real b = difference > 0.0 ? smaller : larger;
  const real b2 = square(b);
  const real R_s = (square(a - c) + b2) / (square(a + c) + b2);
  const real bc2 = b2 * square(c);
  const real ratio = (square(a * c - s2) + bc2) / (square(a * c + s2) + bc2);
  return 0.5 * R_s * (1.0 + ratio);
}

// Lazanyi-Szirmay-Kalos error term fixed at cos_theta_d = 1/7 (about 82 degrees), where the
// reflectance is F82; Kutz, Hasan, Edmondson 2021. Limited to 0..1, which dark F0 would leave.
static inline real fresnel_f82_F(const real one_minus_cos_d, const scalar F0, const scalar F82) {
  const real m = one_minus_cos_d;
  const real m5 = square(square(m)) * m;
  const scalar schlick = F0 + (1.0 - F0) * (7776.0 / 16807.0);  // at 1/7: (6/7)^5
  const scalar b = (schlick - F82) * (823543.0 / 46656.0);
  return at_most(at_least(F0 + (1.0 - F0) * m5 - b * (1.0 - m) * m5 * m, 0.0), 1.0);
}

static inline void fresnel_none(const geometry g, const fresnel_constants c, const real lobe,
                                real *basis) {
  basis[0] = lobe;
}
static inline void fresnel_schlick(const geometry g, const fresnel_constants c, const real lobe,
                                   real *basis) {
  const real s = schlick_weight(g);
  basis[0] = (1.0 - s) * lobe;
  basis[1] = s * lobe;
}
static inline void fresnel_dielectric(const geometry g, const fresnel_constants c,
                                      const real lobe, real *basis) {
  basis[0] = fresnel_dielectric_F(g.one_minus_cos_d, c.a) * lobe;
}
static inline void fresnel_conductor(const geometry g, const fresnel_constants c,
                                     const real lobe, real *basis) {
  basis[0] = fresnel_conductor_F(g.one_minus_cos_d, c.a, c.b) * lobe;
}
static inline void fresnel_f82(const geometry g, const fresnel_constants c, const real lobe,
                               real *basis) {
  basis[0] = fresnel_f82_F(g.one_minus_cos_d, c.a, c.b) * lobe;
}

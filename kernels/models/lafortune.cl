// Lafortune 1997, isotropic: basis (n + 2)/(2 pi) max(C_xy i_xy.o_xy + C_z cos_theta_i cos_theta_o, 0)^n
// with C_xy = -clamp(C, -1, 1), C_z = min(1, 2 - |C|).
// Up to here the series has all digits of its precision.
#if PRECISION == 64
#define LAFORTUNE_NEAR 1e-3
#else
#define LAFORTUNE_NEAR 2e-2
#endif

typedef struct { scalar n, norm, side, lack_xy, lack_z; } lafortune_constants;

static inline lafortune_constants lafortune_prepare(const lafortune_parameters p) {
  const scalar size = fabs(p.C);
  const lafortune_constants c = {p.n, 0.5 * INV_PI * (p.n + 2.0), p.C < 0.0 ? -1.0 : 1.0,
                                 fmax(1.0 - size, 0.0), fmax(size - 1.0, 0.0)};
  return c;
}

static inline void lafortune_basis(const geometry g, const lafortune_constants c, real *basis) {
  // One minus the base of the power, from 1 - r.wo (C > 0) or 1 - wi.wo (C < 0), which are exact
  // where they are small, and from what |C_xy| and C_z lack to 1.
  const real direct =
      0.5 * (projected_distance2(g) + square(g.cos_theta_i - g.cos_theta_o));
  const real y = 0.69314718055994531 * g.log2_cos_r;  // ln(r.wo): 1 - e^y by its series
  const real series = -y * (1.0 + 0.5 * y * (1.0 + y / 3.0 * (1.0 + 0.25 * y * (1.0 + 0.2 * y))));
  const real off_mirror = direct > LAFORTUNE_NEAR ? direct : series;
  const real off_back = 2.0 * g.one_minus_cos_d * (2.0 - g.one_minus_cos_d);
  const real below_one = (c.side > 0.0 ? off_mirror : off_back) -
                         c.lack_xy * c.side * tangential_dot(g) +
                         c.lack_z * (g.cos_theta_i * g.cos_theta_o);
  const real inside = below_one < 1.0 ? below_one : (real)(0.5);
  const real power = exp2(c.n * log2_1p(-inside));
  basis[0] = below_one < 1.0 ? c.norm * power : (real)(0.0);
}

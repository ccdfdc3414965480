// EON: Fujii's Oren-Nayar term and the light that it loses, given back. One basis, the BRDF.
typedef struct { scalar r, single_scatter, multiple_scatter; } eon_constants;

static inline eon_constants eon_prepare(const eon_parameters p) {
  const scalar lost_at_normal = 0.5 - 2.0 / (3.0 * PI);
  const scalar lost_on_average = lost_at_normal - (2.0 / 3.0 - 28.0 / (15.0 * PI));
  const scalar A = 1.0 / (1.0 + lost_at_normal * p.r);
  // 1 - E_F = r A eon_loss / pi: with r A taken out, r = 0 is no 0/0.
  const scalar one_minus_mean = p.r * A * lost_on_average;
  const scalar rho_ms = p.rho * p.rho * (1.0 - one_minus_mean) / (1.0 - p.rho * one_minus_mean);
  const eon_constants c = {p.r, INV_PI * p.rho * A,
                           INV_PI * INV_PI * INV_PI * rho_ms * p.r * A / lost_on_average};
  return c;
}

// pi (1 - E_F) / (r A). The paper's difference is taken out by hand: it vanishes at grazing.
static inline real eon_loss(const real cos_theta, const real sin_theta) {
  const real cos2 = square(cos_theta), w = 1.0 / (1.0 + sin_theta);
  const real lift = cos_theta * cos2 * (sin_theta + 2.0) * square(w) * (1.0 / 3.0);
  return (0.5 * PI - 2.0 / 3.0) * cos2 * w + sin_theta * (asin(cos_theta) - lift);
}

static inline void eon_basis(const geometry g, const eon_constants c, real *basis) {
  const real s = tangential_dot(g);
  const real backward = 1.0 + c.r * s / at_least(g.cos_theta_i, g.cos_theta_o);
  // 1 + s = (|i_xy + o_xy|^2 + cos_theta_i^2 + cos_theta_o^2)/2 does not cancel at the mirror.
  const real one_plus_s =
      0.5 * (projected_distance2(g) + square(g.cos_theta_i) + square(g.cos_theta_o));
  const real forward = (1.0 - c.r) + c.r * one_plus_s;
  const real loss_i = eon_loss(g.cos_theta_i, sqrt(square(g.i_x) + square(g.i_y)));
  const real loss_o = eon_loss(g.cos_theta_o, sqrt(square(g.o_x) + square(g.o_y)));
  basis[0] = c.single_scatter * (s > 0.0 ? backward : forward) +
             c.multiple_scatter * (loss_i * loss_o);
}

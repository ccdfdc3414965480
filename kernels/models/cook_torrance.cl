// Cook-Torrance: D Beckmann, G V-cavity, F Schlick, over 4 cos_theta_i cos_theta_o.
// Bases (1 - s) B and s B, with coefficients k_s F0 and k_s.
typedef struct { scalar alpha; } cook_torrance_constants;

static inline cook_torrance_constants cook_torrance_prepare(const cook_torrance_parameters p) {
  const cook_torrance_constants c = {p.alpha};
  return c;
}

static inline void cook_torrance_basis(const geometry g, const cook_torrance_constants c,
                                       real *basis) {
  const real t2 = tan2_theta_h(g);
  const real lobe = 0.25 * beckmann_D(t2, c.alpha) * v_cavity_G(g, t2) /
                    (g.cos_theta_i * g.cos_theta_o);
  const real s = schlick_weight(g);
  basis[0] = (1.0 - s) * lobe;
  basis[1] = s * lobe;
}

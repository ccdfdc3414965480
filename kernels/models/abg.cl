// ABg: basis 1 / (B + x^g), x the distance of the projected directions from the mirror.
typedef struct { scalar B, half_g; } abg_constants;

// Closer to the mirror than any instrument resolves, and farther than directions in double
// precision are rounded: x^g with a small g would turn that rounding into a result.
#define ABG_SMALLEST_X2 1e-24

static inline abg_constants abg_prepare(const abg_parameters p) {
  const abg_constants c = {p.B, 0.5 * p.g};
  return c;
}

static inline void abg_basis(const geometry g, const abg_constants c, real *basis) {
  const real x2 = at_least(projected_distance2(g), ABG_SMALLEST_X2);
  basis[0] = 1.0 / (c.B + exp2(c.half_g * positive_log2(x2)));
}

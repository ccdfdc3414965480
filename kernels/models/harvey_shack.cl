// Harvey-Shack: basis (1 + (x/l)^2)^(s/2), x the distance of the projected directions from
// the mirror.
typedef struct { scalar inv_l2, half_s; } harvey_shack_constants;

static inline harvey_shack_constants harvey_shack_prepare(const harvey_shack_parameters p) {
  const harvey_shack_constants c = {1.0 / (p.l * p.l), 0.5 * p.s};
  return c;
}

static inline void harvey_shack_basis(const geometry g, const harvey_shack_constants c,
                                      real *basis) {
  basis[0] = exp2(c.half_s * positive_log2(1.0 + c.inv_l2 * projected_distance2(g)));
}

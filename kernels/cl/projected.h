// |i_xy + o_xy|^2: how far the projections of wo and of the mirror direction of wi lie apart,
// squared. In the plane of incidence that is (sin(theta_o) - sin(theta_i))^2.
static inline real projected_distance2(const geometry g) {
  return tan2_theta_h(g) * square(g.cos_theta_i + g.cos_theta_o);
}

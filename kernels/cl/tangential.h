// i_xy . o_xy = cos(phi_o - phi_i) sin(theta_i) sin(theta_o). Kahan's product with the rounding
// of the first product put back: at right angles it stays 0 however grazing, where the diffuse
// models divide it by the larger cosine.
static inline real tangential_dot(const geometry g) {
  const real along_y = g.i_y * g.o_y;
  return fma(g.i_x, g.o_x, along_y) + fma(g.i_y, g.o_y, -along_y);
}

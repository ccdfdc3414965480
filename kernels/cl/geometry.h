// What a formula may know of a pair of directions: the few numbers stored per
// measurement. They are computed once, in double, in forms that do not cancel
// near the mirror direction, so that single precision survives there.
typedef struct {
  real cos_theta_i, cos_theta_o;  // > 0: the host masks what lies below the horizon
  real i_x, i_y, o_x, o_y;        // tangential components of wi and wo
  real slope_x, slope_y;          // tan(theta_h) (cos(phi_h), sin(phi_h)) of the half vector
  real one_minus_cos_d;           // 1 - cos(theta_d), theta_d between wi and the half vector
  real log2_cos_h;                // log2(n.h)
  real log2_cos_r;                // log2(r.wo), r the mirror direction of wi; -1e30 where r.wo <= 0
  real back_slope_x, back_slope_y;  // slope of the half vector of wo and (-i_x, -i_y, i_z)
} geometry;

#define N_PLANES 13

static inline geometry load_geometry(global const real *planes, const int n, const int v) {
  geometry g;
  g.cos_theta_i = planes[v];
  g.cos_theta_o = planes[n + v];
  g.i_x = planes[2 * n + v];
  g.i_y = planes[3 * n + v];
  g.o_x = planes[4 * n + v];
  g.o_y = planes[5 * n + v];
  g.slope_x = planes[6 * n + v];
  g.slope_y = planes[7 * n + v];
  g.one_minus_cos_d = planes[8 * n + v];
  g.log2_cos_h = planes[9 * n + v];
  g.log2_cos_r = planes[10 * n + v];
  g.back_slope_x = planes[11 * n + v];
  g.back_slope_y = planes[12 * n + v];
  return g;
}

// tan^2(theta_h)
static inline real tan2_theta_h(const geometry g) {
  return square(g.slope_x) + square(g.slope_y);
}

// A point that is shaded, with the frame that its BRDF is written in: tangent, bitangent, normal.
typedef struct {
  real p_x, p_y, p_z, n_x, n_y, n_z, t_x, t_y, t_z, b_x, b_y, b_z;
  real o_x, o_y, o_z;  // wo in the frame
} shading_point;

static inline shading_point load_point(global const real *points, const int n, const int v) {
  shading_point s;
  s.p_x = points[v];
  s.p_y = points[n + v];
  s.p_z = points[2 * n + v];
  s.n_x = points[3 * n + v];
  s.n_y = points[4 * n + v];
  s.n_z = points[5 * n + v];
  s.t_x = points[6 * n + v];
  s.t_y = points[7 * n + v];
  s.t_z = points[8 * n + v];
  s.o_x = points[9 * n + v];
  s.o_y = points[10 * n + v];
  s.o_z = points[11 * n + v];
  s.b_x = s.n_y * s.t_z - s.n_z * s.t_y;
  s.b_y = s.n_z * s.t_x - s.n_x * s.t_z;
  s.b_z = s.n_x * s.t_y - s.n_y * s.t_x;
  return s;
}

// Cosines below this are the horizon.
#define HORIZON 1e-6
#if PRECISION == 64
#define BELOW_ONE 0.9999999999999999
#else
#define BELOW_ONE 0.9999999
#endif

// The numbers of geometry.h from unit vectors wi and wo in the frame, as geometry.cl has them
// from angles. What a model does not use, the compiler leaves out.
static inline geometry local_geometry(const real i_x, const real i_y, const real i_z,
                                      const real o_x, const real o_y, const real o_z) {
  geometry g;
  g.cos_theta_i = i_z;
  g.cos_theta_o = o_z;
  g.i_x = i_x;
  g.i_y = i_y;
  g.o_x = o_x;
  g.o_y = o_y;
  const real H_x = i_x + o_x, H_y = i_y + o_y, H_z = i_z + o_z;
  const real delta_x = o_x - i_x, delta_y = o_y - i_y, delta_z = i_z - o_z;
  const real per_H_z = 1.0 / H_z;
  const real H_xy2 = square(H_x) + square(H_y);
  const real sin2_d = 0.25 * (square(delta_x) + square(delta_y) + square(delta_z));
  const real cos_d = 0.5 * sqrt(H_xy2 + square(H_z));
  const real one_minus_cos_r = 0.5 * (H_xy2 + square(delta_z));
  g.slope_x = H_x * per_H_z;
  g.slope_y = H_y * per_H_z;
  g.one_minus_cos_d = sin2_d / (1.0 + cos_d);
  g.log2_cos_h = -0.5 * log2_1p(H_xy2 * square(per_H_z));
  const real log2_cos_r = log2_1p(-at_most(one_minus_cos_r, BELOW_ONE));
  g.log2_cos_r = one_minus_cos_r < 1.0 ? log2_cos_r : (real)(-1e30);
  g.back_slope_x = delta_x * per_H_z;
  g.back_slope_y = delta_y * per_H_z;
  return g;
}

// With CHANNEL_X each channel has nonlinear parameters of its own.
#if CHANNEL_X
#define N_GROUPS N_CHANNELS
#define FIRST_CHANNEL(group) (group)
#define AFTER_CHANNEL(group) ((group) + 1)
#else
#define N_GROUPS 1
#define FIRST_CHANNEL(group) 0
#define AFTER_CHANNEL(group) N_CHANNELS
#endif

// Bit k of DIFFUSE_BITS: basis function k is diffuse.
#define IS_DIFFUSE(k) ((DIFFUSE_BITS >> (k)) & 1)

// BRDF of one channel, parted in diffuse and specular.
static inline void part(const real *basis, global const scalar *coefficient, real *diffuse,
                        real *specular) {
  real d = 0.0, s = 0.0;
  for (int k = 0; k < N_BASIS; ++k) {
    if (IS_DIFFUSE(k)) d += coefficient[k] * basis[k];
    else s += coefficient[k] * basis[k];
  }
  *diffuse = d;
  *specular = s;
}

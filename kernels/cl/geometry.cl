// Directions -> the planes of geometry.h. Compiled with real = double; stores
// in the precision of the sums (STORE).
#if STORE == 64
typedef VECTOR(double) stored;
#define TO_STORED(x) (x)
#else
typedef VECTOR(float) stored;
#define TO_STORED PASTE(convert_, VECTOR(float))
#endif

// angles: theta_i, phi_i, theta_o, phi_o, each n vectors, in radians.
kernel void directions_to_planes(global const real *angles, const int n, global stored *planes) {
  const int v = get_global_id(0);
  const real theta_i = angles[v], phi_i = angles[n + v];
  const real theta_o = angles[2 * n + v], phi_o = angles[3 * n + v];
  const real cos_theta_i = cos(theta_i), cos_theta_o = cos(theta_o);
  const real sin_theta_i = sin(theta_i), sin_theta_o = sin(theta_o);
  const real i_x = sin_theta_i * cos(phi_i), i_y = sin_theta_i * sin(phi_i);
  const real o_x = sin_theta_o * cos(phi_o), o_y = sin_theta_o * sin(phi_o);
  const real H_x = i_x + o_x, H_y = i_y + o_y, H_z = cos_theta_i + cos_theta_o;
  const real H_xy2 = square(H_x) + square(H_y);
  const real delta_z = cos_theta_i - cos_theta_o;
  // |wi - wo|^2 / 4 = 1 - cos^2(theta_d), without cancellation
  const real sin2_d = 0.25 * (square(i_x - o_x) + square(i_y - o_y) + square(delta_z));
  const real cos_d = 0.5 * sqrt(H_xy2 + square(H_z));
  // 1 - r.wo = |r - wo|^2 / 2
  const real one_minus_cos_r = 0.5 * (H_xy2 + square(delta_z));
  const real log2_cos_r = M_LOG2E * log1p(-fmin(one_minus_cos_r, 0.9999999999999999));

  planes[v] = TO_STORED(cos_theta_i);
  planes[n + v] = TO_STORED(cos_theta_o);
  planes[2 * n + v] = TO_STORED(i_x);
  planes[3 * n + v] = TO_STORED(i_y);
  planes[4 * n + v] = TO_STORED(o_x);
  planes[5 * n + v] = TO_STORED(o_y);
  planes[6 * n + v] = TO_STORED(H_x / H_z);
  planes[7 * n + v] = TO_STORED(H_y / H_z);
  planes[8 * n + v] = TO_STORED(sin2_d / (1.0 + cos_d));
  planes[9 * n + v] = TO_STORED(-0.5 * M_LOG2E * log1p(H_xy2 / square(H_z)));
  planes[10 * n + v] = TO_STORED(one_minus_cos_r < 1.0 ? log2_cos_r : (real)(-1e30));
  planes[11 * n + v] = TO_STORED((o_x - i_x) / H_z);
  planes[12 * n + v] = TO_STORED((o_y - i_y) / H_z);
}

// Radiance reflected from an environment: quadrature over half vectors, where a lobe sits at
// the normal whatever the view, up to the horizon of wi. A node looks the environment up in
// the level of its pyramid whose pixels are as large as the node's solid angle.
#if PRECISION == 64
typedef double4 texel;
#else
typedef float4 texel;
#endif

typedef union { real v; scalar lane[WIDTH]; } lanes;

// columns and rows: 0 to 1 across the picture; 4 channels a texel.
static inline void look_up(global const texel *pyramid, const int rows, const int levels,
                           const real column, const real row, const real level, real *radiance) {
  lanes u, w, l, found[4];
  u.v = column;
  w.v = row;
  l.v = level;
  for (int k = 0; k < WIDTH; ++k) {
    const int m = clamp((int)l.lane[k], 0, levels - 1), height = rows >> m, width = 2 * height;
    // Levels before this one hold 2 rows^2 (1 - 4^-m) 4/3 texels.
    const int first = (8 * (rows * rows - height * height)) / 3;
    const scalar x = u.lane[k] * width - 0.5;
    const scalar y = clamp(w.lane[k] * height - (scalar)0.5, (scalar)0.0, (scalar)(height - 1));
    const scalar x0 = floor(x);
    const int y0 = (int)y, y1 = min(y0 + 1, height - 1);
    const int left = ((int)x0) & (width - 1), right = (left + 1) & (width - 1);
    const scalar fx = x - x0, fy = y - y0;
    global const texel *upper = pyramid + first + y0 * width, *lower = pyramid + first + y1 * width;
    const texel a = upper[left] + fx * (upper[right] - upper[left]);
    const texel b = lower[left] + fx * (lower[right] - lower[left]);
    const texel t = a + fy * (b - a);
    found[0].lane[k] = t.x;
    found[1].lane[k] = t.y;
    found[2].lane[k] = t.z;
    found[3].lane[k] = t.w;
  }
  for (int channel = 0; channel < N_CHANNELS; ++channel) radiance[channel] = found[channel].v;
}

// radial: shares of the way to the horizon and their weights; around: azimuths of the half
// vector as cosine, sine and weight. MIRROR and BACK: the nodes crowd about the mirror direction
// of the view, about the view itself, or both in turn with shares that add up to 1.
// out[set][channel][diffuse, specular][point vector]
kernel void shade_environment(global const real *points, const int n, global const scalar *x,
                              global const scalar *coefficients, global const texel *pyramid,
                              const int rows, const int levels, global const scalar *radial,
                              const int n_radial, global const scalar *around,
                              const int n_around, global real *out) {
  const int v = get_global_id(0), set = get_global_id(1);
  const shading_point s = load_point(points, n, v);
  const scalar per_texel = rows * (scalar)rows * INV_PI * INV_PI;
  real sums[2 * N_CHANNELS];
  for (int k = 0; k < 2 * N_CHANNELS; ++k) sums[k] = 0.0;
  constants c[N_GROUPS];
  for (int group = 0; group < N_GROUPS; ++group)
    c[group] = prepare(x + (set * N_GROUPS + group) * N_X);
  for (int back = !MIRROR; back <= BACK; ++back) {
    const scalar side = back ? -1.0 : 1.0;
    for (int a = 0; a < n_around; ++a) {
      const scalar cos_phi = around[3 * a], sin_phi = around[3 * a + 1];
      const real tilt = s.o_x * cos_phi + s.o_y * sin_phi;
      const real theta_end = 0.5 * atan2(s.o_z, -tilt);
      // As far as 45 degrees, shares are of 45 degrees near the normal, as they were laid out.
      const real stretch = at_least(theta_end * (4.0 * INV_PI), 1.0);
      for (int r = 0; r < n_radial; ++r) {
        const scalar u = radial[2 * r];
        const real per_share = 1.0 / (u + (1.0 - u) * stretch);
        const real theta = theta_end * u * per_share;
        const real sin_h = sin(theta), cos_h = cos(theta);
        const real o_dot_h = tilt * sin_h + s.o_z * cos_h;
        const real i_z = at_least(2.0 * o_dot_h * cos_h - s.o_z, HORIZON);
        const real i_x = side * (2.0 * o_dot_h * sin_h * cos_phi - s.o_x);
        const real i_y = side * (2.0 * o_dot_h * sin_h * sin_phi - s.o_y);
        const scalar cell = radial[2 * r + 1] * around[3 * a + 2];
        const real solid = 4.0 * o_dot_h * sin_h * theta_end * stretch * square(per_share) * cell;
        const real d_x = i_x * s.t_x + i_y * s.b_x + i_z * s.n_x;
        const real d_y = i_x * s.t_y + i_y * s.b_y + i_z * s.n_y;
        const real d_z = i_x * s.t_z + i_y * s.b_z + i_z * s.n_z;
        const real column = 0.5 - (0.5 * INV_PI) * atan2(d_y, d_x);
        const real row = INV_PI * atan2(sqrt(square(d_x) + square(d_y)), d_z);
        const real level = 0.5 * log2(at_least(solid * per_texel, 1.0)) - 0.5;
        real radiance[N_CHANNELS];
        look_up(pyramid, rows, levels, column, row, level, radiance);
        const geometry g = local_geometry(i_x, i_y, i_z, s.o_x, s.o_y, s.o_z);
        real weight = solid * i_z;
#if MIRROR && BACK
        const real there = square(i_x + s.o_x) + square(i_y + s.o_y) + square(i_z - s.o_z);
        const real here = square(i_x - s.o_x) + square(i_y - s.o_y) + square(i_z - s.o_z);
        weight *= (back ? there : here) / (here + there + 1e-30);
#endif
        for (int group = 0; group < N_GROUPS; ++group) {
          real basis[N_BASIS];
          evaluate_basis(g, &c[group], basis);
          for (int channel = FIRST_CHANNEL(group); channel < AFTER_CHANNEL(group); ++channel) {
            real diffuse, specular;
            part(basis, coefficients + (set * N_CHANNELS + channel) * N_BASIS, &diffuse,
                 &specular);
            sums[2 * channel] += weight * radiance[channel] * diffuse;
            sums[2 * channel + 1] += weight * radiance[channel] * specular;
          }
        }
      }
    }
  }
  for (int k = 0; k < 2 * N_CHANNELS; ++k) out[(set * 2 * N_CHANNELS + k) * n + v] = sums[k];
}

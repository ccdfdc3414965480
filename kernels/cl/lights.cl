// Radiance by the reflection equation under directional and point lights.
// lights: per light x, y, z, 0 for a direction or 1 for a position, then a value per channel.
// out[set][channel][diffuse, specular][point vector]
kernel void shade_lights(global const real *points, const int n, global const scalar *x,
                         global const scalar *coefficients, global const scalar *lights,
                         const int n_lights, global const scalar *ambient, global real *out) {
  const int v = get_global_id(0), set = get_global_id(1);
  const shading_point s = load_point(points, n, v);
  real sums[2 * N_CHANNELS];
  for (int channel = 0; channel < N_CHANNELS; ++channel) {
    sums[2 * channel] = ambient[set * N_CHANNELS + channel];
    sums[2 * channel + 1] = 0.0;
  }
  for (int group = 0; group < N_GROUPS; ++group) {
    const constants c = prepare(x + (set * N_GROUPS + group) * N_X);
    for (int l = 0; l < n_lights; ++l) {
      global const scalar *light = lights + l * (4 + N_CHANNELS);
      const scalar near = light[3];
      const real to_x = light[0] - near * s.p_x, to_y = light[1] - near * s.p_y,
                 to_z = light[2] - near * s.p_z;
      const real per_distance = rsqrt(square(to_x) + square(to_y) + square(to_z));
      const real falloff = near > 0.0 ? square(per_distance) : (real)(1.0);
      const real cosine = (to_x * s.n_x + to_y * s.n_y + to_z * s.n_z) * per_distance;
      // Where no light falls, it is taken from the normal, which harms no formula.
      const real lit = cosine > HORIZON ? (real)(1.0) : (real)(0.0);
      const real i_x = lit * per_distance * (to_x * s.t_x + to_y * s.t_y + to_z * s.t_z);
      const real i_y = lit * per_distance * (to_x * s.b_x + to_y * s.b_y + to_z * s.b_z);
      const real i_z = cosine > HORIZON ? cosine : (real)(1.0);
      real basis[N_BASIS];
      evaluate_basis(local_geometry(i_x, i_y, i_z, s.o_x, s.o_y, s.o_z), &c, basis);
      const real weight = lit * i_z * falloff;
      for (int channel = FIRST_CHANNEL(group); channel < AFTER_CHANNEL(group); ++channel) {
        real diffuse, specular;
        part(basis, coefficients + (set * N_CHANNELS + channel) * N_BASIS, &diffuse, &specular);
        sums[2 * channel] += weight * light[4 + channel] * diffuse;
        sums[2 * channel + 1] += weight * light[4 + channel] * specular;
      }
    }
  }
  for (int k = 0; k < 2 * N_CHANNELS; ++k) out[(set * 2 * N_CHANNELS + k) * n + v] = sums[k];
}

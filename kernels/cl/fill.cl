// Pixels as weighted sums of points: the polygon's colour (1 tap) or colours between the
// corners (3). values[set][plane][point], out[set][plane][pixel]. A work-item has RUN pixels;
// N_TAPS is given too.
kernel void fill(global const scalar *restrict values, const int n_points,
                 global const int *restrict taps, global const scalar *restrict weights,
                 const int n_pixels, const int n_planes, global scalar *restrict out) {
  const int first = get_global_id(0) * RUN, set = get_global_id(1);
  for (int plane = set * n_planes; plane < (set + 1) * n_planes; ++plane) {
    global const scalar *restrict value = values + (size_t)plane * n_points;
    global scalar *restrict to = out + (size_t)plane * n_pixels;
    for (int pixel = first; pixel < first + RUN; ++pixel) {
#if N_TAPS == 1
      to[pixel] = value[taps[pixel]];
#else
      scalar sum = 0.0;
      for (int k = 0; k < N_TAPS; ++k)
        sum += weights[k * n_pixels + pixel] * value[taps[k * n_pixels + pixel]];
      to[pixel] = sum;
#endif
    }
  }
}

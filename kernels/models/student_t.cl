// Student's t distribution of slopes; masking and Fresnel term are the record's options.
typedef struct {
  scalar gamma;
  student_t_masking masking;
  fresnel_constants fresnel;
} student_t_constants;

static inline student_t_constants student_t_prepare(const student_t_parameters p) {
  const student_t_constants c = {p.gamma, student_t_masking_for(p.alpha, p.gamma),
                                 PASTE(fresnel_constants_, OPTION_fresnel)(p)};
  return c;
}

static inline void student_t_basis(const geometry g, const student_t_constants c, real *basis) {
  const real t2 = tan2_theta_h(g);
  const real divisor = PASTE(divisor_, OPTION_masking)(
      g, t2, student_t_lambda(g.cos_theta_i, square(g.i_x) + square(g.i_y), c.masking),
      student_t_lambda(g.cos_theta_o, square(g.o_x) + square(g.o_y), c.masking));
  const real lobe = student_t_D(t2, c.masking.scale2, c.gamma) / divisor;
  PASTE(fresnel_, OPTION_fresnel)(g, c.fresnel, lobe, basis);
}

// Burley 2012, the "principled" model. Bases with the coefficients base_color, tint and 1.
typedef struct {
  scalar roughness, subsurface, sheen, sheen_tint;  // sheen times 1 - metallic
  scalar dielectric, metallic;                      // weights of the two kinds of body
  scalar F0, F0_tint;                               // of the dielectric: untinted and tinted part
  scalar widths, clearcoat, coat_alpha2, coat_norm;
  roughness_axes axes;
} disney_principled_constants;

static inline disney_principled_constants disney_principled_prepare(
    const disney_principled_parameters p) {
  const scalar aspect = sqrt(1.0 - 0.9 * p.anisotropic);
  const scalar alpha_x = fmax(p.roughness * p.roughness / aspect, 0.001);
  const scalar alpha_y = fmax(p.roughness * p.roughness * aspect, 0.001);
  const scalar dielectric = 1.0 - p.metallic;
  const scalar coat_alpha = 0.1 * (1.0 - p.clearcoat_gloss) + 0.001 * p.clearcoat_gloss;
  const scalar coat_alpha2 = coat_alpha * coat_alpha;
  const scalar F0 = 0.08 * p.specular * dielectric;
  const disney_principled_constants c = {
      p.roughness, p.subsurface, dielectric * p.sheen, p.sheen_tint, dielectric, p.metallic,
      F0 * (1.0 - p.specular_tint), F0 * p.specular_tint, PI * alpha_x * alpha_y,
      0.25 * p.clearcoat, coat_alpha2,
      INV_PI * (coat_alpha2 - 1.0) / log(coat_alpha2),
      roughness_along(p.phi_x, alpha_x, alpha_y)};
  return c;
}

// 4 cos_theta_i cos_theta_o / G, G separable Smith. In the notes of 2012 one roughness for both
// axes, remapped to 1/4..1; without the remapping since the addendum of 2014.
static inline real disney_principled_divisor_burley2012(const geometry g,
                                                        const disney_principled_constants c) {
  const scalar half_way = 0.5 + 0.5 * c.roughness, alpha_g = half_way * half_way;
  return (g.cos_theta_i + ggx_root(g.cos_theta_i, alpha_g)) *
         (g.cos_theta_o + ggx_root(g.cos_theta_o, alpha_g));
}
static inline real disney_principled_divisor_burley2014(const geometry g,
                                                        const disney_principled_constants c) {
  const real root_i = positive_root(square(g.cos_theta_i) + alpha2_sin2(g.i_x, g.i_y, c.axes));
  const real root_o = positive_root(square(g.cos_theta_o) + alpha2_sin2(g.o_x, g.o_y, c.axes));
  return (g.cos_theta_i + root_i) * (g.cos_theta_o + root_o);
}

static inline void disney_principled_basis(const geometry g, const disney_principled_constants c,
                                           real *basis) {
  const real t2 = tan2_theta_h(g), s = schlick_weight(g);
  const real m_i = 1.0 - g.cos_theta_i, m_o = 1.0 - g.cos_theta_o;
  const real s_i = square(square(m_i)) * m_i, s_o = square(square(m_o)) * m_o;
  const real retro = c.roughness * square(1.0 - g.one_minus_cos_d);

  const real diffuse = (1.0 + (2.0 * retro - 0.5) * s_i) * (1.0 + (2.0 * retro - 0.5) * s_o);
  const real flat_ = (1.0 + (retro - 1.0) * s_i) * (1.0 + (retro - 1.0) * s_o);
  const real below = 1.25 * (flat_ * (1.0 / (g.cos_theta_i + g.cos_theta_o) - 0.5) + 0.5);
  const real body = INV_PI * (diffuse + c.subsurface * (below - diffuse));

  const real divisor = PASTE(disney_principled_divisor_, OPTION_masking)(g, c);
  const real lobe =
      square((1.0 + t2) / (1.0 + slope_over_alpha2(g, c.axes))) / (c.widths * divisor);
  const real coat_divisor = (g.cos_theta_i + ggx_root(g.cos_theta_i, 0.25)) *
                            (g.cos_theta_o + ggx_root(g.cos_theta_o, 0.25));
  const real coat = c.clearcoat * c.coat_norm * (1.0 + t2) / ((t2 + c.coat_alpha2) * coat_divisor);

  basis[0] = c.dielectric * body + c.metallic * (1.0 - s) * lobe;
  basis[1] = c.sheen * c.sheen_tint * s + c.F0_tint * (1.0 - s) * lobe;
  basis[2] = c.sheen * (1.0 - c.sheen_tint) * s + (c.F0 * (1.0 - s) + s) * lobe +
             (0.04 + 0.96 * s) * coat;
}

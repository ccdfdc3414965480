/* Directions as plots want them: curves per incidence over a signed viewing angle. */

// Views this far from the plane of incidence still lie in it, in degrees.
const PLANE = 0.5;
const SAME = 0.01;

/** theta_o, negative on the side of the light. */
export function signed(theta, azimuth) {
  return Math.cos((azimuth * Math.PI) / 180) > 0 ? -theta : theta;
}

export function inPlane(theta, azimuth) {
  return theta < PLANE || Math.abs(Math.sin((azimuth * Math.PI) / 180)) < Math.sin((PLANE * Math.PI) / 180);
}

/** Group a table of readings into curves shaped as those of a fit; a scan in no plane is points. */
export function curvesOf(table) {
  const groups = new Map();
  table.theta_i_deg.forEach((theta, row) => {
    const azimuth = table.phi_o_deg[row] - table.phi_i_deg[row];
    const plane = inPlane(table.theta_o_deg[row], theta < PLANE ? 0 : azimuth);
    const key = [
      Math.round(theta / SAME),
      theta < PLANE ? 0 : Math.round(table.phi_i_deg[row] / SAME),
      plane,
    ].join();
    if (!groups.has(key))
      groups.set(key, { theta_i_deg: theta, phi_i_deg: table.phi_i_deg[row], plane, rows: [] });
    groups.get(key).rows.push([signed(table.theta_o_deg[row], azimuth), row]);
  });
  return [...groups.values()]
    .map(({ rows, ...curve }) => {
      rows.sort((a, b) => a[0] - b[0]);
      return {
        ...curve,
        theta_o_deg: rows.map(([angle]) => angle),
        measured: table.values.map((channel) => rows.map(([, row]) => channel[row])),
      };
    })
    .sort((a, b) => a.theta_i_deg - b.theta_i_deg || a.phi_i_deg - b.phi_i_deg);
}

/** A curve of an incidence as its part in the plane and its part beside it. */
export function splitPlane(curve) {
  if (curve.plane || !curve.phi_o_deg) return [curve];
  const beside = curve.theta_o_deg.map(
    (theta, k) => !inPlane(Math.abs(theta), curve.phi_o_deg[k] - curve.phi_i_deg),
  );
  const part = (keep) => {
    const rows = beside.flatMap((is, k) => (is === keep ? [k] : []));
    const take = (list) => rows.map((k) => list[k]);
    return {
      ...curve,
      plane: !keep,
      theta_o_deg: take(curve.theta_o_deg),
      measured: curve.measured.map(take),
      fitted: curve.fitted.map(take),
    };
  };
  return [part(false), part(true)].filter((c) => c.theta_o_deg.length);
}

/** At most `most` of the curves, spread over their range. */
export function spread(curves, most) {
  if (curves.length <= most) return curves.map((_, k) => k);
  return Array.from({ length: most }, (_, k) => Math.round((k * (curves.length - 1)) / (most - 1)));
}

/** What tells a curve from the others, in words. */
export function nameOf(curve, curves) {
  const turned = curves.some(
    (c) =>
      Math.abs(c.phi_i_deg - curve.phi_i_deg) > SAME && Math.abs(c.theta_i_deg - curve.theta_i_deg) < SAME,
  );
  const theta = `${Number(curve.theta_i_deg.toFixed(1))}°`;
  return (
    theta + (turned ? ` at ${Number(curve.phi_i_deg.toFixed(1))}°` : "") + (curve.plane ? "" : " off plane")
  );
}

// Coarse everywhere, fine where lobes are narrow: steps and limits in degrees.
const STEP = 1;
const FINE = 0.25;
const NEAR = 6;
const LIMIT = 89;

/** Viewing angles at which a model is drawn for one incidence. */
export function drawnAngles(theta_i) {
  const angles = new Set();
  for (let angle = -LIMIT; angle <= LIMIT; angle += STEP) angles.add(angle);
  for (const centre of [theta_i, -theta_i]) {
    const middle = Math.round(centre / FINE) * FINE;
    for (let angle = middle - NEAR; angle <= middle + NEAR; angle += FINE)
      if (Math.abs(angle) <= LIMIT) angles.add(angle);
  }
  return [...angles].sort((a, b) => a - b);
}

/** The same in the planes of several incidences, for POST /v1/evaluate: {angles per curve, directions}. */
export function planeDirections(curves) {
  const angles = curves.map((curve) => drawnAngles(curve.theta_i_deg));
  const flat = (of) => curves.flatMap((curve, k) => angles[k].map((angle) => of(curve, angle)));
  return {
    angles,
    directions: {
      theta_i_deg: flat((curve) => curve.theta_i_deg),
      phi_i_deg: flat((curve) => curve.phi_i_deg),
      theta_o_deg: flat((_, angle) => Math.abs(angle)),
      phi_o_deg: flat((curve, angle) => curve.phi_i_deg + (angle < 0 ? 0 : 180)),
    },
  };
}

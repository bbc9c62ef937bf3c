// Metres on the ground near a place, by the radii of curvature of WGS84: exact to 1 mm within a kilometre.
const SEMI_MAJOR_M = 6378137.0;
const ECCENTRICITY2 = 0.0066943799901413165;
const CORNERS = 48;

export function metresPerDegree(lat) {
  const sine = Math.sin(lat * Math.PI / 180);
  const w2 = 1 - ECCENTRICITY2 * sine * sine;
  const meridian = SEMI_MAJOR_M * (1 - ECCENTRICITY2) / (w2 * Math.sqrt(w2));
  const parallel = SEMI_MAJOR_M / Math.sqrt(w2) * Math.cos(lat * Math.PI / 180);
  return { north: meridian * Math.PI / 180, east: parallel * Math.PI / 180 };
}

export function offset(from, to) {
  const scale = metresPerDegree((from[0] + to[0]) / 2);
  return { north: (to[0] - from[0]) * scale.north, east: (to[1] - from[1]) * scale.east };
}

export function moved(from, north, east) {
  const scale = metresPerDegree(from[0]);
  return [from[0] + north / scale.north, from[1] + east / scale.east];
}

// Corners of an ellipse with these semi-axes about its centre, [north, east] in metres; the bearing is the larger one's.
export function outline(ellipse) {
  const turn = ellipse.bearing_deg * Math.PI / 180;
  const corners = [];
  for (let corner = 0; corner < CORNERS; corner += 1) {
    const angle = 2 * Math.PI * corner / CORNERS;
    const along = ellipse.major_m * Math.cos(angle);
    const across = ellipse.minor_m * Math.sin(angle);
    corners.push([along * Math.cos(turn) - across * Math.sin(turn), along * Math.sin(turn) + across * Math.cos(turn)]);
  }
  return corners;
}

// The same on the earth.
export function corners(place, ellipse) {
  return outline(ellipse).map(([north, east]) => moved(place, north, east));
}

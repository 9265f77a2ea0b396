/* SPDX-License-Identifier: MIT */
// This module converts places from an anchor's CRS back to the scene frame, exactly as ANCHOR.md, *From the scene to
// the CRS*, defines it. WGS 84: NIMA TR8350.2. Transverse Mercator: Krueger's series in the form of Karney, Journal of
// Geodesy 85 (2011) 475, to the fourth power of the third flattening: below 0.1 um within a zone. Polar stereographic:
// Snyder, USGS Professional Paper 1395 (1987) 161.

const RAD = Math.PI / 180, A_M = 6378137, F = 1 / 298.257223563, E2 = F * (2 - F), E = Math.sqrt(E2), N = F / (2 - F);
const RADIUS_M = (A_M / (1 + N)) * (1 + N ** 2 / 4 + N ** 4 / 64);
const ALPHA = [N / 2 - (N ** 2 * 2) / 3 + (N ** 3 * 5) / 16 + (N ** 4 * 41) / 180,
  (N ** 2 * 13) / 48 - (N ** 3 * 3) / 5 + (N ** 4 * 557) / 1440, (N ** 3 * 61) / 240 - (N ** 4 * 103) / 140,
  (N ** 4 * 49561) / 161280];
const BETA = [N / 2 - (N ** 2 * 2) / 3 + (N ** 3 * 37) / 96 - N ** 4 / 360,
  N ** 2 / 48 + N ** 3 / 15 - (N ** 4 * 437) / 1440,
  (N ** 3 * 17) / 480 - (N ** 4 * 37) / 840, (N ** 4 * 4397) / 161280];
const UPS_M = (2 * A_M * 0.994) / Math.sqrt((1 + E) ** (1 + E) * (1 - E) ** (1 - E));

export function geodeticToEcef(lat_deg, lon_deg, height_m) {
  const s = Math.sin(lat_deg * RAD), c = Math.cos(lat_deg * RAD), n = A_M / Math.sqrt(1 - E2 * s * s);
  return [(n + height_m) * c * Math.cos(lon_deg * RAD), (n + height_m) * c * Math.sin(lon_deg * RAD),
    (n * (1 - E2) + height_m) * s];
}

// Bowring's iteration (Survey Review 23, 1976); near the Earth only rounding is left after three steps.
function ecefToGeodetic([x_m, y_m, z_m]) {
  const p = Math.hypot(x_m, y_m);
  let beta = Math.atan2(z_m, (1 - F) * p), lat = 0;
  for (let i = 0; i < 3; i++) {
    const s = Math.sin(beta), c = Math.cos(beta);
    lat = Math.atan2(z_m + (E2 / (1 - F)) * A_M * s * s * s, p - E2 * A_M * c * c * c);
    beta = Math.atan2((1 - F) * Math.sin(lat), Math.cos(lat));
  }
  const s = Math.sin(lat);
  return [lat / RAD, Math.atan2(y_m, x_m) / RAD, p * Math.cos(lat) + z_m * s - A_M * Math.sqrt(1 - E2 * s * s)];
}

// Returns the tangent of the conformal latitude from that of the latitude. geographic() is the inverse, by Newton's
// method (Karney's equations 19 to 21).
function conformal(tau) {
  const sec = Math.sqrt(1 + tau * tau), sigma = Math.sinh(E * Math.atanh((E * tau) / sec));
  return tau * Math.sqrt(1 + sigma * sigma) - sigma * sec;
}

function geographic(tauC) {
  let tau = tauC / (1 - E2);
  for (let i = 0; i < 5; i++) {
    const now = conformal(tau);
    const step = ((tauC - now) / Math.sqrt(1 + now * now)) * (1 + (1 - E2) * tau * tau);
    tau += step / ((1 - E2) * Math.sqrt(1 + tau * tau));
  }
  return tau;
}

function series(coefficients, xi, eta) {
  let a = 0, b = 0;
  coefficients.forEach((c, i) => {
    const j = 2 * (i + 1);
    a += c * Math.sin(j * xi) * Math.cosh(j * eta);
    b += c * Math.cos(j * xi) * Math.sinh(j * eta);
  });
  return [a, b];
}

/** Returns the UTM or UPS grid of an EPSG code, which converts degrees to easting and northing in metres, and back.
 * null: the code is of neither. */
export function gridOf(epsg) {
  const isUps = epsg === 32661 || epsg === 32761, isSouth = Math.floor(epsg / 100) === 327, zone = epsg % 100;
  if (!isUps && !((isSouth || Math.floor(epsg / 100) === 326) && zone >= 1 && zone <= 60)) return null;
  return isUps ? upsGrid(isSouth ? -1 : 1) : utmGrid(6 * zone - 183, isSouth ? 1e7 : 0);
}

function upsGrid(side) {
  return {
    forward(lat_deg, lon_deg) {
      const tauC = conformal(Math.tan(lat_deg * RAD)), rho = UPS_M / (side * tauC + Math.sqrt(1 + tauC * tauC));
      return [2e6 + rho * Math.sin(lon_deg * RAD), 2e6 - side * rho * Math.cos(lon_deg * RAD)];
    },
    inverse(easting_m, northing_m) {
      const x = easting_m - 2e6, y = side * (2e6 - northing_m), t = (Math.hypot(x, y) + 1e-30) / UPS_M;
      return [Math.atan(geographic((side * (1 / t - t)) / 2)) / RAD, Math.atan2(x, y) / RAD];
    },
    convergence: (lat_deg, lon_deg) => side * lon_deg * RAD,
  };
}

function utmGrid(lon0_deg, north0_m) {
  const radius_m = 0.9996 * RADIUS_M;
  const forward = (lat_deg, lon_deg) => {
    const tauC = conformal(Math.tan(lat_deg * RAD)), lon = (lon_deg - lon0_deg) * RAD;
    const xi = Math.atan2(tauC, Math.cos(lon)), eta = Math.asinh(Math.sin(lon) / Math.hypot(tauC, Math.cos(lon)));
    const [a, b] = series(ALPHA, xi, eta);
    return [5e5 + radius_m * (eta + b), north0_m + radius_m * (xi + a)];
  };
  return {
    forward,
    inverse(easting_m, northing_m) {
      let xi = (northing_m - north0_m) / radius_m, eta = (easting_m - 5e5) / radius_m;
      const [a, b] = series(BETA, xi, eta);
      xi -= a;
      eta -= b;
      const tau = geographic(Math.sin(xi) / Math.hypot(Math.sinh(eta), Math.cos(xi)));
      return [Math.atan(tau) / RAD, lon0_deg + Math.atan2(Math.sinh(eta), Math.cos(xi)) / RAD];
    },
    // The convergence follows from a difference over 22 m, and is good to 1e-10 rad.
    convergence(lat_deg, lon_deg) {
      const [e0, n0] = forward(lat_deg - 1e-4, lon_deg), [e1, n1] = forward(lat_deg + 1e-4, lon_deg);
      return Math.atan2(e0 - e1, n1 - n0);
    },
  };
}

// Returns the EPSG code of the scene's own grid, in which the station has its scene coordinates. 0: there is none.
function gridOfScene(a) {
  if (a.lat_deg === 0 && a.lon_deg === 0 && a.height_m === 0) return 0;
  const zone = Math.floor((a.lon_deg + 180) / 6), codes = [32661, 32761];
  for (const side of [32600, 32700]) for (const k of [59, 60, 61]) codes.push(side + ((zone + k) % 60) + 1);
  return codes.find((epsg) => {
    const at = gridOf(epsg).forward(a.lat_deg, a.lon_deg);
    return Math.max(Math.abs(at[0] - a.station_m[0]), Math.abs(at[1] - a.station_m[1])) < 1e-3;
  }) ?? 0;
}

const transposedTimes = (m, v) => [0, 1, 2].map((i) => m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2]);

// Returns a function that turns a difference in ECEF into one in the scene frame.
function sceneTurn(a, grid) {
  if (a.crs === 1) return (d) => transposedTimes(a.axes, d);
  let [lat_deg, lon_deg] = a.anchor, g = 0;
  if (grid) {
    [lat_deg, lon_deg] = grid.inverse(a.anchor[0], a.anchor[1]);
    g = grid.convergence(lat_deg, lon_deg);
  }
  const s = Math.sin(lat_deg * RAD), c = Math.cos(lat_deg * RAD);
  const sl = Math.sin(lon_deg * RAD), cl = Math.cos(lon_deg * RAD);
  const east = [-sl, -s * cl, c * cl, cl, -s * sl, c * sl, 0, c, s];
  const north = [Math.cos(g), Math.sin(g), 0, -Math.sin(g), Math.cos(g), 0, 0, 0, 1];
  return (d) => transposedTimes(a.axes, transposedTimes(north, transposedTimes(east, d)));
}

/** Returns the geoid's height above the ellipsoid if heights of the anchor's CRS are above the geoid; else 0. */
export function geoidHeight(a) {
  return a.heights === 1 && (a.moving & 1) === 0 ? a.height_m - a.anchor[2] : 0;
}

/** Returns {at, isFlat}. at([x, y, z]) takes a place in the anchor's CRS to the scene frame, metres. isFlat: at() is
 * only the anchor's axes, transposed, and a shift. If a head moves and heights are above the geoid, the geoid's height
 * is not known. Heights are then taken as ellipsoidal, and the whole scene is too low or too high by the geoid's
 * height. */
export function toScene(a) {
  if (a.crs === 0) return {isFlat: true, at: (p) => p};
  const geoid_m = geoidHeight(a);
  const own = gridOfScene(a), grid = a.crs === 2 ? gridOf(a.epsg) : null;
  const lift_m = a.station_m[2] - a.height_m; // a scene in a grid has heights that differ by this
  if (own !== 0 && own === a.epsg) return {at: (p) => [p[0], p[1], p[2] + geoid_m + lift_m]};
  const toEcef = (p) => {
    if (a.crs === 1) return p;
    const [lat_deg, lon_deg] = grid ? grid.inverse(p[0], p[1]) : p;
    return geodeticToEcef(lat_deg, lon_deg, p[2] + geoid_m);
  };
  if (own !== 0) {
    return {at: (p) => {
      const [lat_deg, lon_deg, height_m] = ecefToGeodetic(toEcef(p));
      return [...gridOf(own).forward(lat_deg, lon_deg), height_m + lift_m];
    }};
  }
  const home = geodeticToEcef(a.lat_deg, a.lon_deg, a.height_m), back = sceneTurn(a, grid);
  return {isFlat: a.crs === 1, at: (p) => plus(a.station_m, back(minus(toEcef(p), home)))};
}

const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

// ---- a polynomial for the same, since the exact way takes a microsecond a point

const POWERS = [];
for (let i = 0; i < 4; i++) for (let j = 0; i + j < 4; j++) for (let k = 0; i + j + k < 4; k++) POWERS.push([i, j, k]);

/** Returns the cubic in u, v, w through `map` at the 20 places of a tetrahedral lattice in -1..1: 60 coefficients,
 * those of x, then y, then z, in the order of POWERS (1, w, w2, w3, v, vw, vw2, v2, v2w, v3, u, uw, uw2, uv, uvw, uv2,
 * u2, u2w, u2v, u3). */
export function fitCubic(map) {
  const rows = POWERS.map(([i, j, k]) => {
    const [u, v, w] = [i, j, k].map((m) => [0, 1, -1, 0.5][m]);
    return [...POWERS.map(([a, b, c]) => u ** a * v ** b * w ** c), ...map(u, v, w)];
  });
  for (let c = 0; c < 20; c++) { // Gauss and Jordan, the largest as pivot
    const best = rows.reduce((b, row, r) => (r > c && Math.abs(row[c]) > Math.abs(rows[b][c]) ? r : b), c);
    [rows[c], rows[best]] = [rows[best], rows[c]];
    for (let r = 0; r < 20; r++) {
      const f = r === c ? 0 : rows[r][c] / rows[c][c];
      if (f !== 0) for (let k = c; k < 23; k++) rows[r][k] -= f * rows[c][k];
    }
  }
  return Float64Array.from({length: 60}, (_, i) => rows[i % 20][20 + Math.floor(i / 20)] / rows[i % 20][i % 20]);
}

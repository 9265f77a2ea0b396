/* SPDX-License-Identifier: MIT */
// This module has the colour scales: a figure's place between its limits, 0 to 1, becomes a colour. The module is pure.
//
// Low and high mean the same on every scale, and the same as in files (core/colour.h): low is blue or dark, high is red
// or bright. `even` and `blue` are computed in OKLab (Ottosson 2020), whose lightness is that of the eye. The lightness
// rises evenly from end to end, so people who don't tell red from green see every step, and so does a grey print.

// The stops are evenly spaced. On `spectrum` the hue says the figure, in the order of the files' colours.
const STOPS = {
  spectrum: ['#3b4cc0', '#2f7fe0', '#1fb2c9', '#35c98b', '#8fd14f', '#e0c93f', '#f39a35', '#e4572e', '#b5213f'],
  steel: ['#31364a', '#46618c', '#5b8db0', '#86b4bf', '#bfd2c8', '#f2ead2'],
  ember: ['#2f3b66', '#5b3f86', '#92428b', '#c84c76', '#ef6b52', '#fb9a3f', '#ffd166'],
};

// These scales are computed in OKLab. The lightness rises from DARK to BRIGHT. EVEN gives hue and chroma, as [a, b], at
// the place f between the limits.
const DARK = 0.32, BRIGHT = 0.92;
const polar = (hue, chroma) => [chroma * Math.cos(hue), chroma * Math.sin(hue)];
const BLUE = polar(4.62, 0.105), YELLOW = polar(1.87, 0.125);
const EVEN = {
  even: (f) => polar(5.05 - 3.15 * f, 0.097 + 0.045 * (2 * f - 1) ** 2), // violet, blue, teal, green, yellow
  blue: (f) => BLUE.map((v, k) => v + f * (YELLOW[k] - v)), // blue, grey, yellow: the colours that red-green blindness leaves
};

// A user may choose these; each has its name. `usual` is the mode's own.
export const SCALES = [['usual', 'Usual'], ['even', 'Violet to yellow'], ['blue', 'Blue to yellow'], ['grey', 'Grey']];

export const parse = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

// Converts OKLab to linear light of sRGB, and that light to sRGB's bytes (IEC 61966-2-1).
function fromOklab(L, a, b) {
  const [l, m, s] = [L + 0.3963377774 * a + 0.2158037573 * b, L - 0.1055613458 * a - 0.0638541728 * b,
    L - 0.0894841775 * a - 1.291485548 * b].map((v) => v ** 3);
  const linear = [4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s,
    -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s, -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s];
  return linear.map((v) => 255 * Math.min(1, Math.max(0, v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055)));
}

// Returns [r, g, b] of 0 to 255, not rounded.
export function rampAt(name, f) {
  const part = Math.min(Math.max(f, 0), 1);
  if (name === 'grey') return [255 * part, 255 * part, 255 * part]; // as colour_reflectance has it
  if (EVEN[name]) return fromOklab(DARK + (BRIGHT - DARK) * part, ...EVEN[name](part));
  const stops = STOPS[name];
  const at = part * (stops.length - 1);
  const i = Math.min(Math.floor(at), stops.length - 2);
  const a = parse(stops[i]), b = parse(stops[i + 1]);
  return a.map((v, c) => v + (at - i) * (b[c] - v));
}

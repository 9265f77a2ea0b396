/* SPDX-License-Identifier: MIT */
// This module has the picture's colours for shaders and overlay. Ground, ink and accent are the page's (CSS
// variables). The others are one of two sets, by whether the page is light or dark.

let probe = null;

// Returns [r, g, b] of 0 to 1, from any CSS colour.
function parts(css) {
  probe ??= Object.assign(document.createElement('canvas'), {width: 1, height: 1}).getContext('2d', {willReadFrequently: true});
  probe.fillStyle = '#000';
  probe.fillStyle = css;
  probe.fillRect(0, 0, 1, 1);
  return [...probe.getImageData(0, 0, 1, 1).data].slice(0, 3).map((c) => c / 255);
}

export function readTheme(element) {
  const style = getComputedStyle(element);
  const css = Object.fromEntries(['ground', 'ink', 'accent'].map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  const ground = parts(css.ground);
  const dark = ground[0] + ground[1] + ground[2] < 1.5;
  return {css, ground, ink: parts(css.ink), accent: parts(css.accent),
    scene: dark ? [0.62, 0.72, 0.82] : [0.25, 0.33, 0.42], solid: dark ? [0.36, 0.4, 0.44] : [0.74, 0.77, 0.8],
    mesh: dark ? [0.62, 0.65, 0.68] : [0.8, 0.81, 0.82]};
}

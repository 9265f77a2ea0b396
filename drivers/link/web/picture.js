/* SPDX-License-Identifier: MIT */
// This module makes pictures to keep: the canvases with the legend, as a PNG file.

const FONT = 'system-ui, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';
export const css = ([r, g, b]) => `rgb(${r}, ${g}, ${b})`;

export const MOST_ITEMS = 14; // of a list that a legend shows
export const moreItems = (n) => `and ${n} more`;

// Returns a 2D canvas with these canvases over each other, of the size of the first one.
export function copyOf(...layers) {
  const [{width, height}] = layers;
  const copy = Object.assign(document.createElement('canvas'), {width, height});
  const context = copy.getContext('2d');
  for (const layer of layers) context.drawImage(layer, 0, 0, width, height);
  return copy;
}

// Draws a legend (view.legend()) into the upper left corner. colours: {ground, ink}; nameOf(item) names a list's items.
export function drawLegend(canvas, legend, colours, nameOf, scale = 1) {
  const c = canvas.getContext('2d'), rows = legend.items?.slice(0, MOST_ITEMS) ?? [];
  const more = (legend.items?.length ?? 0) - rows.length;
  const width = 214, height = legend.items ? 28 + 18 * (rows.length + (more > 0 ? 1 : 0)) : 62;
  c.save();
  c.scale(scale, scale);
  c.translate(10, 10);
  c.globalAlpha = 0.92;
  c.fillStyle = colours.ground;
  c.fillRect(0, 0, width, height);
  c.globalAlpha = 1;
  c.fillStyle = colours.ink;
  c.textBaseline = 'middle';
  c.font = `600 13px ${FONT}`;
  c.fillText(legend.unit ? `${legend.title}, ${legend.unit}` : legend.title, 8, 14);
  c.font = `12px ${FONT}`;
  if (legend.items) drawItems(c, rows, nameOf, colours);
  else drawRamp(c, legend, colours);
  if (more > 0) c.fillText(moreItems(more), 26, 33 + 18 * rows.length);
  c.restore();
}

function drawItems(c, rows, nameOf, colours) {
  rows.forEach((item, k) => {
    c.fillStyle = css(item.colour);
    c.fillRect(8, 27 + 18 * k, 11, 11);
    c.fillStyle = colours.ink;
    c.fillText(nameOf(item), 26, 33 + 18 * k, 180);
  });
}

function drawRamp(c, {stops, ticks, from, to}, colours) {
  const ramp = c.createLinearGradient(10, 0, 204, 0);
  stops.forEach((stop, i) => ramp.addColorStop(i / (stops.length - 1), css(stop)));
  c.fillStyle = ramp;
  c.fillRect(10, 26, 194, 10);
  c.fillStyle = colours.ink;
  for (const {at, text} of ticks.length > 0 ? ticks : [{at: 0, text: String(from)}, {at: 1, text: String(to)}]) {
    c.textAlign = at < 0.05 ? 'left' : at > 0.95 ? 'right' : 'center';
    c.fillText(text.replace('-', '−'), 10 + 194 * at, 48);
  }
}

// Hands a file to the user.
export function download(blob, name) {
  const link = Object.assign(document.createElement('a'), {href: URL.createObjectURL(blob), download: name});
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000); // the browser reads it meanwhile
}

// Names a file by the time and its ending: "scanhead-2026-01-31-121530.png".
export function fileName(ending, date = new Date()) {
  const two = (n) => String(n).padStart(2, '0');
  const day = [date.getFullYear(), two(date.getMonth() + 1), two(date.getDate())].join('-');
  return `scanhead-${day}-${[date.getHours(), date.getMinutes(), date.getSeconds()].map(two).join('')}.${ending}`;
}

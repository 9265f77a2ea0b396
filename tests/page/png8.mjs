/* SPDX-License-Identifier: MIT */
// This makes a picture with 256 colours: a browser's PNG (8 bits a channel, not interlaced) becomes a smaller one, for
// documents. The module needs node 20.15 or later.
import zlib from 'node:zlib';

function* chunks(png) {
  for (let at = 8, n; at < png.length; at += 12 + n) {
    n = png.readUInt32BE(at);
    yield {type: png.toString('latin1', at + 4, at + 8), bytes: png.subarray(at + 8, at + 8 + n)};
  }
}

// Returns {width, height, size: bytes of a pixel, out: all pixels}. Undoes the filter of each row (PNG specification,
// 9.2).
export function pixelsOf(png) {
  const all = [...chunks(png)], head = all[0].bytes, width = head.readUInt32BE(0), height = head.readUInt32BE(4);
  const size = {2: 3, 6: 4}[head[9]];
  const raw = zlib.inflateSync(Buffer.concat(all.filter(({type}) => type === 'IDAT').map(({bytes}) => bytes)));
  const row = width * size, out = Buffer.alloc(row * height);
  for (let y = 0; y < height; y++) {
    const kind = raw[y * (row + 1)];
    for (let i = 0; i < row; i++) {
      const a = i >= size ? out[y * row + i - size] : 0, b = y > 0 ? out[(y - 1) * row + i] : 0;
      const c = i >= size && y > 0 ? out[(y - 1) * row + i - size] : 0, p = a + b - c;
      const paeth = Math.abs(p - a) <= Math.abs(p - b) && Math.abs(p - a) <= Math.abs(p - c) ? a : Math.abs(p - b) <= Math.abs(p - c) ? b : c;
      out[y * row + i] = raw[y * (row + 1) + 1 + i] + [0, a, b, (a + b) >> 1, paeth][kind];
    }
  }
  return {width, height, size, out};
}

// Returns the mean colours of the 256 fullest cells of a grid of 16 x 16 x 16, and the nearest of them for each cell.
function paletteOf({out, size}) {
  const cells = Array.from({length: 4096}, (_, cell) => ({cell, n: 0, sum: [0, 0, 0]}));
  const cellOf = (i) => (out[i] >> 4 << 8) | (out[i + 1] >> 4 << 4) | (out[i + 2] >> 4);
  for (let i = 0; i < out.length; i += size) {
    const cell = cells[cellOf(i)];
    cell.n++;
    for (let k = 0; k < 3; k++) cell.sum[k] += out[i + k];
  }
  const used = cells.filter(({n}) => n > 0).sort((a, b) => b.n - a.n);
  for (const cell of used) cell.mean = cell.sum.map((v) => Math.round(v / cell.n));
  const palette = used.slice(0, 256).map(({mean}) => mean), nearest = new Uint8Array(4096);
  for (const {cell, mean} of used) {
    let least = Infinity;
    palette.forEach((colour, k) => {
      const d = colour.reduce((sum, v, j) => sum + (v - mean[j]) ** 2, 0);
      if (d < least) [least, nearest[cell]] = [d, k];
    });
  }
  return {palette, indexOf: (i) => nearest[cellOf(i)]};
}

export function inFewColours(png) {
  const picture = pixelsOf(png), {width, height, size} = picture, {palette, indexOf} = paletteOf(picture);
  const rows = Buffer.alloc((width + 1) * height), head = Buffer.alloc(13);
  for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) rows[y * (width + 1) + 1 + x] = indexOf(size * (y * width + x));
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(height, 4);
  head.set([8, 3, 0, 0, 0], 8);
  const chunk = (type, bytes) => {
    const body = Buffer.concat([Buffer.from(type, 'latin1'), bytes]), ends = Buffer.alloc(8);
    ends.writeUInt32BE(bytes.length, 0);
    ends.writeUInt32BE(zlib.crc32(body), 4);
    return Buffer.concat([ends.subarray(0, 4), body, ends.subarray(4)]);
  };
  return Buffer.concat([png.subarray(0, 8), chunk('IHDR', head), chunk('PLTE', Buffer.from(palette.flat())),
    chunk('IDAT', zlib.deflateSync(rows, {level: 9, memLevel: 9})), chunk('IEND', Buffer.alloc(0))]);
}

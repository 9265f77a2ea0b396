/* SPDX-License-Identifier: MIT */
// This is the CRC-32C of RFC 3720 (reflected polynomial 0x82f63b78). It takes eight bytes a step: slicing by 8, after
// Kounavis and Berry, "Novel Table Lookup-Based Algorithms for High-Performance CRC Generation", IEEE Transactions on
// Computers 57 (2008).

// Table k, from 256 k on, has the value that a byte adds to the register when k bytes follow it.
const table = new Int32Array(8 * 256);
for (let n = 0; n < 256; n++) {
  let c = n;
  for (let k = 0; k < 8; k++) c = (c >>> 1) ^ (c & 1 ? 0x82f63b78 : 0);
  table[n] = c;
}
for (let i = 256; i < table.length; i++) table[i] = (table[i - 256] >>> 8) ^ table[table[i - 256] & 255];

/** Returns the CRC of the bytes from..to of a DataView, 0 to 2^32 - 1. */
export function crc32c(view, from, to) {
  let c = -1, at = from;
  for (; to - at >= 8; at += 8) {
    const a = c ^ view.getInt32(at, true), b = view.getInt32(at + 4, true);
    c = table[1792 + (a & 255)] ^ table[1536 + ((a >>> 8) & 255)] ^ table[1280 + ((a >>> 16) & 255)] ^
      table[1024 + (a >>> 24)] ^ table[768 + (b & 255)] ^ table[512 + ((b >>> 8) & 255)] ^
      table[256 + ((b >>> 16) & 255)] ^ table[b >>> 24];
  }
  for (; at < to; at++) c = table[(c ^ view.getUint8(at)) & 255] ^ (c >>> 8);
  return ~c >>> 0;
}

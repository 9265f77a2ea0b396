/* SPDX-License-Identifier: MIT */
// A reader gives its products to scanhead on descriptor 3, in the form below, and an error on descriptor 4. Numbers are in
// the machine's byte order. Coordinates are metres, y up.
//
//   head     "shifc01\0"
//   product  u32 express id; u32 parts; u32 failures that the reader reported; u32 length of text
//            text: type of the product, '\n', the first failure, perhaps empty; UTF-8; zeros up to a multiple of 8
//            parts
//   part     u32 vertices; u32 triangles; f32[4] colour: red, green, blue, opacity, 0..1
//            f64 largest coordinate that was rounded to single precision on the way
//            f64[3] for each vertex; u32[3] for each triangle; zeros up to a multiple of 8
//   end      a product of id 0 without parts and text: without it the result is cut off
import fs from 'node:fs'
import v8 from 'node:v8'

const RESULT = 3, NOTE = 4, EDITS = 5, MAX_TEXT = 400

function write(bytes) {
  for (let done = 0; done < bytes.length;) done += fs.writeSync(RESULT, bytes, done)
}

// For a file below this size, reading takes less time than compiling the optimised code would.
const SMALL = 6e6

const bytes_of = array => new Uint8Array(array.buffer, array.byteOffset, array.byteLength)

// Puts texts that are longer than what they replace into a copy of the file.
function spliced(bytes, longer) {
  const out = new Uint8Array(longer.reduce((n, { text, length }) => n + text.length - length, bytes.length))
  let from = 0, to = 0
  for (const { place, length, text } of longer) {
    out.set(bytes.subarray(from, place), to)
    out.set(text, to + place - from)
    to += place - from + text.length
    from = place + length
  }
  out.set(bytes.subarray(from), to)
  return out
}

// Descriptor 5 has the file's size on a line, and a line "place length text" for each part of the file that gives way
// to a text (ifc_edits.h). The places are those of the file as it is, in their order. A file may take a large part of
// the memory that is allowed, so a text that fits is written into its place, and blanks follow.
function edited(bytes, lines) {
  const [size, ...edits] = lines.split('\n')
  const longer = []
  if (edits.length > 1 && bytes.length !== Number(size)) throw new Error('the file changed while it was read')
  for (const edit of edits.slice(0, -1)) {
    const [, at, n, line] = /^(\d+) (\d+) (.*)$/.exec(edit)
    const place = Number(at), length = Number(n), text = Buffer.from(line, 'latin1')
    if (text.length > length) longer.push({ place, length, text })
    else bytes.fill(32, place, place + length).set(text, place)
  }
  return longer.length > 0 ? spliced(bytes, longer) : bytes
}

export function load(file) {
  const bytes = edited(bytes_of(fs.readFileSync(file)), fs.readFileSync(EDITS, 'latin1'))
  if (bytes.length < SMALL) v8.setFlagsFromString('--liftoff-only')
  return bytes
}

const filling = n => new Uint8Array((8 - n % 8) % 8)

export function begin() {
  write(Buffer.from('shifc01\0', 'latin1'))
}

// parts: [{ vertex: Float64Array, index: Uint32Array, colour: [r, g, b, a], largest }]
export function product(id, type, failures, parts) {
  const text = Buffer.from(`${type}\n${failures.length > 0 ? failures[0] : ''}`.slice(0, MAX_TEXT), 'utf8')
  write(bytes_of(new Uint32Array([id, parts.length, failures.length, text.length])))
  write(text)
  write(filling(text.length))
  for (const { vertex, index, colour, largest } of parts) {
    write(bytes_of(new Uint32Array([vertex.length / 3, index.length / 3])))
    write(bytes_of(new Float32Array(colour)))
    write(bytes_of(new Float64Array([largest])))
    write(bytes_of(vertex))
    write(bytes_of(index))
    write(filling(index.byteLength))
  }
}

export function end() {
  write(bytes_of(new Uint32Array([0, 0, 0, 0])))
}

// Sends one line as a struct import_note of core/import/import_child.h: kind 3 is an error, code -1 means a wrong file.
export function fail(error) {
  const note = Buffer.alloc(528), put = new DataView(note.buffer, note.byteOffset)
  const little = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1
  put.setInt32(0, 3, little)
  put.setInt32(4, -1, little)
  note.write(String(error?.message ?? error).replace(/\s+/g, ' ').slice(0, MAX_TEXT), 16, 511, 'utf8')
  fs.writeSync(NOTE, note)
  process.exit(1)
}

// Multiplies points by a 4 x 4 matrix, given column by column, in double. A point takes `stride` numbers of `local`;
// the first three are x, y and z.
export function placed(local, stride, m) {
  const n = local.length / stride, vertex = new Float64Array(3 * n)
  let largest = 0
  for (let i = 0; i < n; i++) {
    const x = local[stride * i], y = local[stride * i + 1], z = local[stride * i + 2]
    largest = Math.max(largest, Math.abs(x), Math.abs(y), Math.abs(z))
    for (let k = 0; k < 3; k++) vertex[3 * i + k] = m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k]
  }
  return { vertex, largest: largest * Math.max(...m.slice(0, 12).map(Math.abs)) }
}

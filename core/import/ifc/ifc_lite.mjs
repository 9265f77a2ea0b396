/* SPDX-License-Identifier: MIT */
// ifc-lite reads an IFC file, and this program writes its bodies to descriptor 3, in the form of result.mjs.
// Descriptor 5 gives changes to the file; it may be empty.
//   node ifc_lite.mjs FILE LEVEL      LEVEL is lowest, low, medium, high or highest; it sets how fine curves are cut up
import fs from 'node:fs'
import { createRequire } from 'node:module'
import { begin, end, fail, load, placed, product } from './result.mjs'

for (const name of ['log', 'warn', 'error', 'info', 'debug']) console[name] = () => {}

// These items have no surface: plans, texts and axes. They do not count as failures of a body.
const NO_BODY = /^Ifc(GeometricCurveSet|GeometricSet|Text|Annotation|Polyline|IndexedPolyCurve|TrimmedCurve|Composite|Line|Circle$|Point)/

function failures_of(diagnostics) {
  if (!diagnostics) return []
  const cut = (diagnostics.failuresByReason ?? []).map(f => `${f.count} x ${f.reason}`)
  const lost = (diagnostics.unsupportedItemsByType ?? []).filter(f => !NO_BODY.test(f.reason))
  return cut.concat(lost.map(f => `${f.count} x ${f.reason} left out`))
}

function part_of(mesh) {
  const [x, y, z] = mesh.origin
  return { index: mesh.indices, colour: [...mesh.color],
    ...placed(mesh.positions, 3, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1]) }
}

// The reader gets one product at a time, so that a failure belongs to a product.
function run_job(api, pre, job) {
  const rtc = pre.needsShift ? pre.rtcOffset : [0, 0, 0]
  const made = api.processGeometryBatchFromSource(pre.jobs.subarray(3 * job, 3 * job + 3), pre.unitScale, ...rtc,
    pre.needsShift, pre.voidKeys, pre.voidCounts, pre.voidValues, pre.styleIds, pre.styleColors,
    pre.planeAngleToRadians, pre.materialElementIds, pre.materialColorCounts, pre.materialColors)
  // ifc-lite subtracted this from coordinates before rounding them; it is turned to y up here.
  const back = [rtc[0], rtc[2], -rtc[1]]
  const parts = []
  let type = ''
  for (let i = 0; i < made.length; i++) {
    const mesh = made.takeMesh(i)
    type = mesh.ifcType
    if (mesh.indices.length > 0) {
      const part = part_of(mesh)
      for (let k = 0; k < part.vertex.length; k++) part.vertex[k] += back[k % 3]
      parts.push(part)
    }
    mesh.free()
  }
  const failures = failures_of(made.diagnostics)
  if (parts.length > 0 || failures.length > 0) product(pre.jobs[3 * job], type, failures, parts)
  made.free()
}

try {
  const bytes = load(process.argv[2])
  const lite = await import('@ifc-lite/wasm')
  lite.initSync({ module: fs.readFileSync(createRequire(import.meta.url).resolve('@ifc-lite/wasm/ifc-lite_bg.wasm')) })
  const api = new lite.IfcAPI()
  api.setMergeLayers(true)
  api.setTessellationQuality(process.argv[3])
  const pre = api.buildPrePassOnce(bytes)
  api.setSourceBytes(bytes)
  begin()
  for (let job = 0; job < pre.totalJobs; job++) run_job(api, pre, job)
  end()
} catch (error) {
  fail(error)
}
process.exit(0)

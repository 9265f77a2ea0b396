/* SPDX-License-Identifier: MIT */
// web-ifc reads an IFC file, and this program writes its bodies to descriptor 3, in the form of result.mjs.
// Descriptor 5 gives changes to the file; it may be empty.
//   node web_ifc.mjs FILE SEGMENTS      SEGMENTS is the number of segments of a full circle
import { createRequire } from 'node:module'
import { begin, end, fail, load, placed, product } from './result.mjs'

// web-ifc logs to the console: a line for each failure, before the product that has it.
const failures = []
for (const name of ['log', 'warn', 'error', 'info', 'debug'])
  console[name] = (...text) => failures.push(text.join(' ').replace(/^\[WEB-IFC\]\[\w+\]/, ''))

function part_of(api, model, placed_geometry) {
  const geometry = api.GetGeometry(model, placed_geometry.geometryExpressID)
  const local = api.GetVertexArray(geometry.GetVertexData(), geometry.GetVertexDataSize())
  const index = api.GetIndexArray(geometry.GetIndexData(), geometry.GetIndexDataSize()).slice()
  const { x, y, z, w } = placed_geometry.color
  const part = { index, colour: [x, y, z, w], ...placed(local, 6, placed_geometry.flatTransformation) }
  geometry.delete()
  return part
}

function stream(api, model) {
  api.StreamAllMeshes(model, mesh => {
    const parts = []
    for (let i = 0; i < mesh.geometries.size(); i++) {
      const part = part_of(api, model, mesh.geometries.get(i))
      if (part.index.length > 0) parts.push(part)
    }
    product(mesh.expressID, api.GetNameFromTypeCode(api.GetLineType(model, mesh.expressID)), failures.splice(0), parts)
  })
}

try {
  const bytes = load(process.argv[2])
  const web = createRequire(import.meta.url)('web-ifc')
  const api = new web.IfcAPI()
  await api.Init()
  api.SetLogLevel(web.LogLevel.LOG_LEVEL_ERROR)
  const model = api.OpenModel(bytes, {
    COORDINATE_TO_ORIGIN: false,
    CIRCLE_SEGMENTS: Number(process.argv[3]),
  })
  if (model < 0) throw new Error('it can\'t open the file')
  failures.length = 0
  begin()
  stream(api, model)
  end()
} catch (error) {
  fail(error)
}
process.exit(0)

// SPDX-License-Identifier: Apache-2.0
// A tileset in the form of docs/formats.md, of a plain: quick to make, however large.
import { mkdirSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";

function glb(count, low, edge) {
  const rows = new Uint16Array(6 * count);
  for (let i = 0; i < count; ++i) rows.set([(i * 40503) & 65535, (i * 30011) & 65535, 0, 0, 128, 0], 6 * i);
  const scale = edge / 65535;
  let json = JSON.stringify({
    asset: { version: "2.0" }, extensionsUsed: ["KHR_mesh_quantization"], extensionsRequired: ["KHR_mesh_quantization"], scene: 0,
    scenes: [{ nodes: [0] }], meshes: [{ primitives: [{ mode: 0, attributes: { POSITION: 0, _INTENSITY: 1, _LABELS: 2 } }] }],
    nodes: [{ mesh: 0, rotation: [-Math.SQRT1_2, 0, 0, Math.SQRT1_2], translation: [low[0], 0, -low[1]], scale: [scale, scale, scale] }],
    buffers: [{ byteLength: 12 * count }], bufferViews: [{ buffer: 0, byteLength: 12 * count, byteStride: 12 }],
    accessors: [{ bufferView: 0, componentType: 5123, type: "VEC3", count, min: [0, 0, 0], max: [65535, 65535, 0] },
      { bufferView: 0, byteOffset: 8, componentType: 5121, normalized: true, type: "SCALAR", count },
      { bufferView: 0, byteOffset: 8, componentType: 5121, type: "VEC4", count }],
  });
  json = json.padEnd(Math.ceil(json.length / 4) * 4);
  const head = Buffer.alloc(20), tail = Buffer.alloc(8);
  [0x46546c67, 2, 28 + json.length + 12 * count, json.length, 0x4e4f534a].forEach((word, i) => head.writeUInt32LE(word, 4 * i));
  tail.writeUInt32LE(12 * count, 0);
  tail.writeUInt32LE(0x004e4942, 4);
  return Buffer.concat([head, Buffer.from(json), tail, Buffer.from(rows.buffer)]);
}

/** Gives the number of files. */
export function writeTileset(folder, points) {
  const aTile = 16384, levels = Math.ceil(Math.log(Math.max(4, points / aTile)) / Math.log(4));
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder);
  let files = 0;
  const node = (level, x, y) => {
    const edge = (25.6 * 2 ** levels) / 2 ** level, low = [x * edge - 100, y * edge - 100], uri = `${level}_${x}_${y}_0.glb`;
    writeFileSync(join(folder, uri), glb(aTile, low, edge));
    ++files;
    const children = level === levels ? [] : [0, 1, 2, 3].map((i) => node(level + 1, 2 * x + (i & 1), 2 * y + (i >> 1)));
    return { boundingVolume: { box: [low[0] + edge / 2, low[1] + edge / 2, 0, edge / 2, 0, 0, 0, edge / 2, 0, 0, 0, 1] },
      geometricError: level === levels ? 0 : edge / 128, refine: "ADD", content: { uri }, children };
  };
  const root = node(0, 0, 0);
  writeFileSync(join(folder, "tileset.json"), JSON.stringify({ asset: { version: "1.1" }, geometricError: root.geometricError * 128, root }));
  return files;
}

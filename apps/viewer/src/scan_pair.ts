// SPDX-License-Identifier: Apache-2.0
// Two scans laid on each other, and their descriptors side by side, on plain canvases.
import { Vector3 } from "three";
import { colourAt, kinds, ofTruth } from "./colours";
import { h, toggle } from "./dom";
import { readFloats, readJson } from "./files";
import { toMatrix } from "./model";

export interface Descriptor {
  rings: number;
  sectors: number;
  intensity: number[];
  occupied: number[];
}

const side = 330;

function canvasOf(width: number, height: number, label: string): [HTMLCanvasElement, CanvasRenderingContext2D] {
  const canvas = h("canvas", { width, height, role: "img", "aria-label": label, class: "picture" });
  return [canvas, canvas.getContext("2d")!];
}

/** `along`: the axis that is drawn upwards, 1 for a view from above, 2 for one from the side. */
function drawPoints(context: CanvasRenderingContext2D, points: Float32Array, pose: number[] | null, colour: string, range_m: number, along: 1 | 2) {
  const T = pose ? toMatrix(pose) : null, p = new Vector3(), { width, height } = context.canvas;
  const scale = width / (2 * range_m);
  context.fillStyle = colour;
  context.globalAlpha = 0.55;
  const step = 4 * Math.max(1, Math.floor(points.length / 4 / 40000));
  for (let i = 0; i + 2 < points.length; i += step) {
    p.set(points[i]!, points[i + 1]!, points[i + 2]!);
    if (T) p.applyMatrix4(T);
    const up = along === 1 ? p.y : p.z;
    context.fillRect(width / 2 + scale * p.x - 0.6, (along === 1 ? height / 2 : 0.75 * height) - scale * up - 0.6, 1.3, 1.3);
  }
  context.globalAlpha = 1;
}

function drawScale(context: CanvasRenderingContext2D, range_m: number) {
  const { width, height } = context.canvas, metres = range_m > 40 ? 20 : range_m > 15 ? 10 : 5, length = (metres * width) / (2 * range_m);
  context.fillStyle = context.strokeStyle = "#777";
  context.fillRect(8, height - 10, length, 2);
  context.font = "11px sans-serif";
  context.fillText(`${metres} m`, 8, height - 14);
}

export async function overlay(view: string, query: number, match: number, pose: number[], true_pose?: number[]): Promise<HTMLElement> {
  const [a, b] = await Promise.all([readFloats(`${view}/scans/${match}.bin`), readFloats(`${view}/scans/${query}.bin`)]);
  if (a.length === 0 && b.length === 0) return h("p", { class: "hint" }, "The map keeps no points of these two scans.");
  const ranges: number[] = [];
  for (let i = 0; i < a.length; i += 40) ranges.push(Math.max(Math.abs(a[i]!), Math.abs(a[i + 1]!)));
  ranges.sort((x, y) => x - y);
  const range_m = Math.min(80, Math.max(8, 1.1 * (ranges[Math.floor(0.95 * ranges.length)] ?? 30)));
  const views = ([[1, side], [2, 120]] as const).map(([along, height]) =>
    ({ along, canvas: canvasOf(side, height, along === 1 ? "Both scans from above" : "Both scans from the side") }));
  const draw = (showTruth: boolean) => {
    for (const { along, canvas: [canvas, context] } of views) {
      context.clearRect(0, 0, canvas.width, canvas.height);
      drawPoints(context, a, null, kinds[0]!, range_m, along);
      drawPoints(context, b, pose, kinds[1]!, range_m, along);
      if (showTruth) drawPoints(context, b, true_pose!, ofTruth, range_m, along);
      drawScale(context, range_m);
    }
  };
  draw(false);
  return h("figure", {}, ...views.map(({ canvas }) => canvas[0]), true_pose ? toggle("This scan at its true pose, too", false, draw) : null,
    h("figcaption", {}, h("span", { class: "key", style: `--key:${kinds[0]}` }, "earlier scan"),
      h("span", { class: "key", style: `--key:${kinds[1]}` }, "this scan, at the pose that was found"),
      true_pose ? h("span", { class: "key", style: `--key:${ofTruth}` }, "at the true pose") : null,
      " From above (x to the right), and from the side."));
}

function drawDescriptor(context: CanvasRenderingContext2D, d: Descriptor, shift: number) {
  const width = context.canvas.width / d.sectors, height = context.canvas.height / d.rings;
  context.fillStyle = "#0c0c10";
  context.fillRect(0, 0, context.canvas.width, context.canvas.height);
  for (let sector = 0; sector < d.sectors; ++sector)
    for (let ring = 0; ring < d.rings; ++ring) {
      const cell = sector * d.rings + ring;
      if (!d.occupied[cell] && !d.intensity[cell]) continue;
      context.fillStyle = `#${colourAt("viridis", 0.1 + 0.9 * Math.sqrt(d.intensity[cell]! / 255)).getHexString()}`;
      const column = (((sector + shift) % d.sectors) + d.sectors) % d.sectors;
      context.fillRect(column * width, (d.rings - 1 - ring) * height, width + 0.5, height + 0.5);
    }
}

export async function descriptors(view: string, query: number, match: number, pose: number[] | undefined): Promise<HTMLElement> {
  const [a, b]: Descriptor[] = await Promise.all([readJson(`${view}/descriptors/${match}.json`), readJson(`${view}/descriptors/${query}.json`)]);
  const yaw = pose ? Math.atan2(2 * (pose[6]! * pose[5]! + pose[3]! * pose[4]!), 1 - 2 * (pose[4]! ** 2 + pose[5]! ** 2)) : 0;
  const shift = Math.round((yaw / (2 * Math.PI)) * a!.sectors);
  return h("figure", {}, ...([[a!, 0, "Descriptor of the earlier scan"], [b!, shift, "Descriptor of this scan, shifted"]] as const).map(([d, by, label]) => {
    const [canvas, context] = canvasOf(side, 90, label);
    drawDescriptor(context, d, by);
    return canvas;
  }), h("figcaption", {}, `Intensity scan context of the earlier scan (upper) and of this one, shifted by ${shift} of ${a!.sectors} columns ` +
    `(${((yaw * 180) / Math.PI).toFixed(0)} degrees). Across: direction; upwards: distance; bright: strong reflection; dark: nothing there.`));
}

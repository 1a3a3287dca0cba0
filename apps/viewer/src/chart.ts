// SPDX-License-Identifier: Apache-2.0
// A chart with axes, titles and units, as SVG.
import { svg } from "./dom";

export interface Series {
  points: [number, number][];
  colour: string;
  kind: "line" | "bars" | "dots";
  label?: string;
}
export interface Axis {
  title: string;
  range: [number, number];
}

const width = 340, height = 220, left = 52, right = 12, top = 26, bottom = 40;

/** Round numbers that span a range in about four steps. */
export function ticks([low, high]: [number, number]): number[] {
  const raw = (high - low || 1) / 4, power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((f) => f * power).find((s) => s >= raw)!;
  const result: number[] = [];
  for (let t = Math.ceil(low / step - 1e-9) * step; t <= high + 1e-9 * step; t += step) result.push(Number(t.toPrecision(6)));
  return result;
}

export function chart(title: string, x: Axis, y: Axis, series: Series[]): SVGElement {
  const toX = (v: number) => left + ((v - x.range[0]) / (x.range[1] - x.range[0] || 1)) * (width - left - right);
  const toY = (v: number) => height - bottom - ((v - y.range[0]) / (y.range[1] - y.range[0] || 1)) * (height - top - bottom);
  const root = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title, class: "chart" });
  root.append(svg("text", { x: left, y: 16, class: "title" }, title));
  for (const t of ticks(x.range)) {
    root.append(svg("line", { x1: toX(t), x2: toX(t), y1: top, y2: height - bottom, class: "grid" }));
    root.append(svg("text", { x: toX(t), y: height - bottom + 14, class: "tick", "text-anchor": "middle" }, String(t)));
  }
  for (const t of ticks(y.range)) {
    root.append(svg("line", { x1: left, x2: width - right, y1: toY(t), y2: toY(t), class: "grid" }));
    root.append(svg("text", { x: left - 5, y: toY(t) + 3, class: "tick", "text-anchor": "end" }, String(t)));
  }
  root.append(svg("text", { x: (left + width - right) / 2, y: height - 6, class: "axis", "text-anchor": "middle" }, x.title));
  root.append(svg("text", { x: 0, y: 0, class: "axis", "text-anchor": "middle", transform: `translate(12 ${(top + height - bottom) / 2}) rotate(-90)` }, y.title));
  series.forEach(({ points, colour, kind, label }, i) => {
    const seen = points.filter(([a, b]) => Number.isFinite(a) && Number.isFinite(b));
    if (kind === "line") {
      root.append(svg("polyline", { points: seen.map(([a, b]) => `${toX(a).toFixed(1)},${toY(b).toFixed(1)}`).join(" "), stroke: colour, class: "curve" }));
    } else if (kind === "dots") {
      for (const [a, b] of seen) root.append(svg("circle", { cx: toX(a), cy: toY(b), r: 3.5, fill: colour }));
    } else {
      const bar = seen.length > 1 ? toX(seen[1]![0]) - toX(seen[0]![0]) - 2 : 20;
      for (const [a, b] of seen)
        root.append(svg("rect", { x: toX(a) - bar / 2, y: toY(b), width: Math.max(1, bar), height: Math.max(0, height - bottom - toY(b)), fill: colour }));
    }
    if (label) root.append(svg("text", { x: width - right, y: 16 + 12 * i, class: "tick", "text-anchor": "end", style: `fill:${colour}` }, label));
  });
  return root;
}

// SPDX-License-Identifier: Apache-2.0
// Figures of the run: precision and recall, probabilities, errors, milliseconds.
import { chart } from "./chart";
import { kinds, ofFalse, ofOdometry } from "./colours";
import { h, number, slider } from "./dom";
import type { Triple, View } from "./model";

const same_place_m = 4;  // docs/evaluation.md

/** Of retrieval: an answer is right where the place is within 4 m. One point a score, the surest first. */
export function precisionRecall(view: View): { score: number; precision: number; recall: number }[] {
  const answers = view.answers.filter(([, match]) => match !== null).sort((a, b) => b[2] - a[2]);
  let right = 0;
  return answers.map(([, , score, distance], i) => {
    if (distance !== null && distance < same_place_m) ++right;
    return { score, precision: right / (i + 1), recall: right / Math.max(1, view.revisits) };
  });
}

const largest = (points: [number, number][], least: number): number => points.reduce((most, [, y]) => Math.max(most, y), least);

function histogram(values: number[], bins: number): [number, number][] {
  const counts = new Array<number>(bins).fill(0);
  for (const value of values) counts[Math.min(bins - 1, Math.max(0, Math.floor(value * bins)))]!++;
  return counts.map((count, i) => [(i + 0.5) / bins, count]);
}

function precisionRecallPart(view: View, setThreshold: (score: number) => void): HTMLElement | null {
  const curve = precisionRecall(view);
  if (!view.has_truth || view.revisits === 0 || curve.length === 0) return null;
  const place = h("div"), text = h("p", { class: "figure" });
  const show = (i: number) => {
    const at = curve[Math.min(curve.length - 1, i)]!;
    place.replaceChildren(chart("Precision and recall of retrieval", { title: "recall", range: [0, 1] }, { title: "precision", range: [0, 1.02] }, [
      { points: curve.map((p) => [p.recall, p.precision]), colour: kinds[0]!, kind: "line" },
      { points: [[at.recall, at.precision]], colour: kinds[5]!, kind: "dots" }]));
    text.textContent = `Scores from ${number(at.score, 2)} on: precision ${number(at.precision)}, recall ${number(at.recall)}. Loops below are grey.`;
    setThreshold(at.score);
  };
  const part = h("section", {}, place, slider("Answers taken", 1, curve.length, 1, curve.length, (value) => show(value - 1)), text);
  show(curve.length - 1);
  setThreshold(-Infinity);
  return part;
}

function probabilityPart(view: View): HTMLElement | null {
  const known = view.loops.filter((loop) => loop.probability !== undefined);
  if (known.length === 0) return null;
  const accepted = histogram(known.filter((l) => l.accepted).map((l) => l.probability!), 20);
  const refused = histogram(known.filter((l) => !l.accepted).map((l) => l.probability!), 20);
  const most = Math.max(1, ...accepted.map((b) => b[1]), ...refused.map((b) => b[1]));
  const part = h("section", {}, chart("Probability that a pose is right", { title: "probability", range: [0, 1] },
    { title: "candidates", range: [0, most] }, [
      { points: refused, colour: "#999999", kind: "bars", label: "refused" },
      { points: accepted, colour: kinds[0]!, kind: "bars", label: "accepted" }]));
  const judged = known.filter((loop) => loop.right !== undefined);
  if (judged.length < 5) return part;
  const bins: [number, number][] = [];
  for (let low = 0; low < 0.999; low += 0.1) {
    const inside = judged.filter((l) => l.probability! >= low && (l.probability! < low + 0.1 || low > 0.85));
    if (inside.length > 0) bins.push([inside.reduce((sum, l) => sum + l.probability!, 0) / inside.length, inside.filter((l) => l.right).length / inside.length]);
  }
  part.append(chart("Reliability of that probability", { title: "probability, mean of a tenth", range: [0, 1] },
    { title: "share that is right", range: [0, 1.02] }, [
      { points: [[0, 0], [1, 1]], colour: "#999999", kind: "line" }, { points: bins, colour: kinds[0]!, kind: "dots" }]));
  return part;
}

function errorPart(view: View): HTMLElement | null {
  const { pose, truth, odometry, stamp_s } = view.scans;
  const start = stamp_s[0] ?? 0;
  const distance = (a: number[], b: Triple) => Math.hypot(a[0]! - b[0], a[1]! - b[1], a[2]! - b[2]);
  const after: [number, number][] = [], before: [number, number][] = [];
  truth.forEach((place, i) => {
    if (!place) return;
    after.push([stamp_s[i]! - start, distance(pose[i]!, place)]);
    if (odometry[i]) before.push([stamp_s[i]! - start, distance(odometry[i]!, place)]);
  });
  if (after.length < 2 || view.command === "detect") return null;
  const end = after.at(-1)![0], most = largest(after, 0.1);
  return h("section", {}, chart("Distance from the truth, after closing loops", { title: "time, s", range: [0, end] }, { title: "m", range: [0, most * 1.05] },
    [{ points: after, colour: kinds[0]!, kind: "line" }]),
    before.length > 1 ? chart("The same of odometry alone", { title: "time, s", range: [0, end] },
      { title: "m", range: [0, largest(before, 0.1) * 1.05] }, [{ points: before, colour: ofOdometry, kind: "line" }]) : null);
}

function timePart(view: View): HTMLElement | null {
  const stages = Object.entries(view.run.ms_per_scan ?? {}).filter(([name]) => name !== "all");
  if (stages.length === 0) return null;
  const most = Math.max(...stages.map(([, ms]) => ms), 0.01);
  return h("section", {}, h("h3", {}, "Milliseconds a scan, by stage"),
    ...stages.sort((a, b) => b[1] - a[1]).map(([name, ms]) => h("div", { class: "bar" }, h("span", {}, name.replaceAll("_", " ")),
      h("meter", { min: 0, max: most, value: ms, "aria-label": `${name}: ${ms.toFixed(2)} ms` }), h("output", {}, `${number(ms)} ms`))));
}

function memoryPart(view: View): HTMLElement | null {
  const used = view.run.memory_mb ?? [];
  if (used.length < 2) return null;
  return h("section", {}, chart("Memory of the program", { title: "scan", range: [0, used.at(-1)![0]] }, { title: "MB", range: [0, largest(used, 1) * 1.05] },
    [{ points: used, colour: kinds[0]!, kind: "line" }]));
}

function matrixPart(view: View): HTMLElement | null {
  const accepted = view.loops.filter((loop) => loop.accepted);
  if (accepted.length === 0) return null;
  const place = (frame: number) => view.index.get(frame) ?? frame;  // sessions one after the other
  const of = (right: boolean): [number, number][] =>
    accepted.filter((l) => (l.right === false) === !right).map((l) => [place(l.query), place(l.match)]);
  const last = largest(accepted.map((l) => [0, place(l.query)]), view.scans.frame.length);
  return h("section", {}, chart("Which scans met", { title: "scan (query)", range: [0, last] }, { title: "earlier scan (match)", range: [0, last] },
    [{ points: of(true), colour: kinds[0]!, kind: "dots" }, { points: of(false), colour: ofFalse, kind: "dots" }]));
}

export function chartsTab(view: View, setThreshold: (score: number) => void): HTMLElement {
  const counts = Object.entries(view.run.counts ?? {});
  return h("div", { class: "tab" },
    precisionRecallPart(view, setThreshold), probabilityPart(view), errorPart(view), timePart(view), memoryPart(view), matrixPart(view),
    view.has_truth ? null : h("p", { class: "hint" }, "With a reference (revisit evaluate FOLDER --reference POSES) this page also shows precision, recall and errors."),
    counts.length > 0 ? h("section", {}, h("h3", {}, "Counts"), h("dl", {}, ...counts.flatMap(([name, value]) => [h("dt", {}, name.replaceAll("_", " ")), h("dd", {}, String(value))]))) : null);
}

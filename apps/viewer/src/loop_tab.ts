// SPDX-License-Identifier: Apache-2.0
// One loop, or one refused candidate: what was found, and why it was believed or not.
import { h, number } from "./dom";
import { frameName, type Loop, type View } from "./model";
import { descriptors, overlay } from "./scan_pair";

function bar(name: string, value: number | undefined, words: string, most = 1): HTMLElement | null {
  if (value === undefined || !Number.isFinite(value)) return null;
  return h("div", { class: "bar" }, h("span", {}, name),
    h("meter", { min: 0, max: most, value: Math.max(0, Math.min(most, value)), "aria-label": `${name}: ${value.toFixed(2)}` }),
    h("output", {}, number(value)), h("small", {}, words));
}

function evidence(loop: Loop): HTMLElement {
  const e = loop.evidence ?? {};
  return h("section", {}, h("h3", {}, "Evidence"),
    bar("probability", loop.probability, "that the pose is right, from all below"),
    bar("inliers", e.inlier_ratio ?? loop.inlier_ratio, "share of each scan's points that lie on the other's surfaces"),
    bar("distinctiveness", e.inlier_share, "inliers against what consecutive scans of this place share: between shelves everything fits", 1.2),
    bar("free space", e.free_space_agreement, "share of what one scan sees through that is empty in the other"),
    bar("intensity", e.intensity_agreement, "how alike the surfaces reflect, against consecutive scans", 1.2),
    bar("overlap", e.overlap, "of both scans seen from overhead"),
    bar("fixed", e.least_fixed, "how well surfaces hold the pose where they hold it least: a corridor lets it slide"),
    loop.evidence ? null : h("p", { class: "hint" }, "The other measures stand in evidence.csv, which is not in this folder for this pair."));
}

function verdict(loop: Loop): HTMLElement {
  if (!loop.accepted) return h("p", { class: "verdict refused" }, `Refused: ${loop.reason || "no reason was noted"}.`);
  if (loop.right === false) return h("p", { class: "verdict false" }, `False loop: its pose is ${number(loop.error_m)} m and ${number(loop.error_deg, 1)}° from the truth.`);
  if (loop.right) return h("p", { class: "verdict right" }, `Right: ${number(loop.error_m, 3)} m and ${number(loop.error_deg)}° from the truth.`);
  return h("p", { class: "verdict" }, "Accepted; no reference says whether it is right.");
}

function measures(loop: Loop): HTMLElement {
  const [x, y, z] = loop.pose ?? [];
  return h("dl", {},
    ...[["pose in the earlier scan", loop.pose ? `${number(x)}, ${number(y)}, ${number(z)} m` : "none was found"],
        ["residual", loop.rmse_m === undefined && !loop.evidence ? "–" : `${number((loop.rmse_m ?? loop.evidence?.rmse_m ?? NaN) * 100, 1)} cm`],
        ["score", number(loop.score)]].flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}

export class LoopTab {
  readonly root = h("div", { class: "tab" });
  private shown = 0;

  constructor(private readonly step: (by: number) => void) {
    this.show(null, null);
  }

  show(view: View | null, loop: Loop | null) {
    const mine = ++this.shown;
    const steps = h("div", { class: "steps" }, h("button", { type: "button", click: () => this.step(-1) }, "◀ Previous"),
      h("button", { type: "button", click: () => this.step(1) }, "Next ▶"));
    if (!view || !loop) {
      this.root.replaceChildren(steps, h("p", { class: "hint" }, "Click a loop's line, or go to the next one (key N)."));
      return;
    }
    const pictures = h("div");
    this.root.replaceChildren(steps, h("h2", {}, `Scan ${frameName(loop.query)} → ${frameName(loop.match)}`), verdict(loop), measures(loop), evidence(loop), pictures);
    const add = async (what: Promise<HTMLElement>, name: string) => {
      const place = h("div", { class: "hint" }, `${name} …`);
      pictures.append(place);
      try {
        const figure = await what;
        if (mine === this.shown) place.replaceWith(figure);
      } catch (problem) {
        place.textContent = `${name}: ${(problem as Error).message}`;
      }
    };
    if (loop.pose) void add(overlay(view.name, loop.query, loop.match, loop.pose, loop.true_pose), "Scans");
    void add(descriptors(view.name, loop.query, loop.match, loop.pose), "Descriptors");
  }
}

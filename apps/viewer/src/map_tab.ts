// SPDX-License-Identifier: Apache-2.0
// How the map is drawn.
import { gradientOf, kinds, loopGradient, ofFalse, ofOdometry, ofRefused, ofTruth } from "./colours";
import { choice, h, slider, toggle } from "./dom";
import type { View } from "./model";
import { scaleOf, type ColourBy } from "./points";
import type { Stage } from "./stage";

function legend(by: ColourBy, view: View, heights: [number, number]): HTMLElement {
  const colours = scaleOf[by];
  if (!colours) {
    return h("p", { class: "keys" }, ...view.sessions.map((name, i) =>
      h("span", { class: "key", style: `--key:${kinds[i % kinds.length]}` }, `session ${i}: ${name.split("/").pop()}`)));
  }
  const ends = { intensity: ["weak reflection", "strong"], height: [`${heights[0].toFixed(0)} m`, `${heights[1].toFixed(0)} m`], time: ["first seen early", "late"], session: ["", ""] }[by];
  return scale(gradientOf(colours), ends[0]!, ends[1]!);
}

function scale(colours: string, from: string, to: string | HTMLElement): HTMLElement {
  return h("div", { class: "legend" }, h("span", {}, from), h("i", { style: `background:${colours}` }), typeof to === "string" ? h("span", {}, to) : to);
}

const duration_s = ({ scans }: View): number => (scans.stamp_s.at(-1) ?? 0) - (scans.stamp_s[0] ?? 0);

export class MapTab {
  readonly root: HTMLElement;
  private readonly legend = h("div");
  private readonly duration = h("span");
  readonly status = h("p", { class: "hint", id: "drawn" });
  readonly measured = h("p", { id: "measured", class: "figure", "aria-live": "polite" });
  isMeasuring = false;

  constructor(private readonly stage: Stage, private readonly view: View, private readonly heights: [number, number]) {
    const each = (work: (side: Stage["sides"][number]) => void) => () => {
      for (const side of stage.sides) work(side);
      stage.draw();
    };
    const uniform = (name: string, value: unknown) => each((side) => {
      if (side.points) side.points.material.uniforms[name]!.value = value;
    })();
    const low = Math.floor(heights[0] - 5), high = Math.ceil(heights[1] + 30);
    const has = (values: unknown[]) => values.some((value) => value !== null);
    this.root = h("div", { class: "tab" },
      h("div", { class: "steps" }, h("button", { type: "button", click: () => stage.frame(true) }, "From above"),
        h("button", { type: "button", click: () => stage.frame(false) }, "From a corner")),
      choice("Colour by", [["intensity", "intensity"], ["height", "height"], ["time", "time"], ["session", "session"]], "height", (by) => this.colourBy(by as ColourBy)),
      this.legend,
      slider("Point size", 1, 8, 0.5, 2, (value) => uniform("size", value * stage.renderer.getPixelRatio()), " px"),
      slider("Brightness", 0.3, 4, 0.1, 1, (value) => uniform("brightness", value)),
      slider("Lowest shown", low, high, 0.5, low, (value) => uniform("lowZ", value === low ? -1e9 : value), " m"),
      slider("Highest shown", low, high, 0.5, high, (value) => uniform("highZ", value === high ? 1e9 : value), " m"),
      toggle("Points", true, (on) => each((side) => side.points && (side.points.group.visible = on))()),
      toggle("Trajectory, coloured by time", true, (on) => each((side) => (side.trajectories.after.visible = on))()),
      scale(gradientOf("cividis"), "0 s", this.duration),
      has(view.scans.odometry) ? toggle("Odometry, before closing loops", false, (on) => each((side) => (side.trajectories.before.visible = on))()) : null,
      has(view.scans.truth) ? toggle("Truth", false, (on) => each((side) => (side.trajectories.truth.visible = on))()) : null,
      toggle("Loops, coloured by probability", true, (on) => each((side) => (side.loops.group.visible = on))()),
      scale(loopGradient, "0.5", "1"),
      toggle("Refused candidates", false, (on) => each((side) => {
        side.loops.showRefused = on;
        side.loops.draw();
      })()),
      h("p", { class: "keys" }, h("span", { class: "key", style: `--key:${ofFalse}` }, "false loop"), h("span", { class: "key", style: `--key:${ofRefused}` }, "refused"),
        h("span", { class: "key", style: `--key:${ofOdometry}` }, "odometry"), h("span", { class: "key", style: `--key:${ofTruth}` }, "truth")),
      toggle("Measure: click two points", false, (on) => {
        this.isMeasuring = on;
        this.measured.textContent = "";
      }),
      this.measured, this.status);
    this.colourBy("height");
    this.update(view);
  }

  /** After the view has grown. */
  update(view: View) {
    this.duration.textContent = `${duration_s(view).toFixed(0)} s`;
  }

  colourBy(by: ColourBy) {
    this.legend.replaceChildren(legend(by, this.view, this.heights));
    const select = this.root?.querySelector("select");
    if (select) select.value = by;
    for (const side of this.stage.sides) side.points?.colourBy(by);
    this.stage.draw();
  }
}

// SPDX-License-Identifier: Apache-2.0
// The drive in time: where the robot was, and what it saw then. Of two results both, each so long after its start.
import * as THREE from "three";
import { h } from "./dom";
import { isReport, readFloats } from "./files";
import { frameName, toMatrix } from "./model";
import type { Side, Stage } from "./stage";

/** Seconds since the first scan; where nobody drove, or another session begins, a tenth of a second. */
function momentsOf(stamp_s: number[]): number[] {
  let now_s = 0;
  return stamp_s.map((stamp, i) => {
    const step_s = i === 0 ? 0 : stamp - stamp_s[i - 1]!;
    return (now_s += step_s >= 0 && step_s < 2 ? step_s : 0.1);
  });
}

export class Timeline {
  readonly root: HTMLElement;
  private readonly input: HTMLInputElement;
  private readonly label = h("output", { id: "moment" });
  private readonly button: HTMLButtonElement;
  private playing = 0;
  private readonly shown = new Map<Side, number>();

  constructor(private readonly stage: Stage) {
    const count = this.side.view.scans.frame.length;
    this.input = h("input", { type: "range", min: 0, max: Math.max(0, count - 1), value: 0, "aria-label": "Moment of the drive", input: () => this.show(this.input.valueAsNumber) });
    this.button = h("button", { type: "button", "aria-label": "Play the drive", click: () => this.toggle() }, "▶");
    this.root = h("div", { id: "timeline", hidden: count === 0 }, this.button, this.input, this.label);
  }

  private get side(): Side {
    return this.stage.sides[0]!;
  }

  /** After the view has grown. */
  update() {
    const count = this.side.view.scans.frame.length;
    this.input.max = String(Math.max(0, count - 1));
    this.root.hidden = count === 0;
  }

  toggle() {
    if (this.playing) {
      clearInterval(this.playing);
      this.playing = 0;
    } else {
      const moments = momentsOf(this.side.view.scans.stamp_s), last = moments.length - 1, times = 10;  // as fast as it was driven
      if (this.input.valueAsNumber >= last) this.show(0);
      const begin_ms = performance.now(), from_s = moments[this.input.valueAsNumber]!;
      this.playing = window.setInterval(() => {  // by the clock: a picture may take long
        const now_s = from_s + (times * (performance.now() - begin_ms)) / 1000;
        let i = this.input.valueAsNumber;
        while (i < last && moments[i + 1]! <= now_s) ++i;
        if (this.input.valueAsNumber >= last) this.toggle();
        else if (i > this.input.valueAsNumber) this.show(i);
      }, 100);
    }
    this.button.textContent = this.playing ? "❚❚" : "▶";
  }

  step(by: number) {
    this.show(Math.min(Number(this.input.max), Math.max(0, this.input.valueAsNumber + by)));
  }

  show(i: number) {
    const { frame, stamp_s } = this.side.view.scans;
    if (frame[i] === undefined) return;
    const since_s = stamp_s[i]! - stamp_s[0]!;
    this.input.value = String(i);
    this.label.textContent = `${since_s.toFixed(1)} s, scan ${frameName(frame[i]!)}`;
    this.showSide(this.side, i);
    for (const other of this.stage.sides.slice(1)) {
      const stamps = other.view.scans.stamp_s, after = stamps.findIndex((t) => t - stamps[0]! >= since_s);
      if (stamps.length > 0) this.showSide(other, after < 0 ? stamps.length - 1 : after);
    }
    this.stage.draw();
  }

  private showSide(side: Side, i: number) {
    const { pose, keyframe } = side.view.scans;
    side.robot.visible = true;
    side.robot.matrixAutoUpdate = false;
    side.robot.matrix.copy(toMatrix(pose[i]!));
    let seen = i;  // points are kept of key frames
    while (seen > 0 && !keyframe[seen]) --seen;
    if (!isReport && seen !== this.shown.get(side)) void this.showScan(side, seen);
  }

  private async showScan(side: Side, i: number) {
    this.shown.set(side, i);
    const { frame, pose } = side.view.scans;
    try {
      const points = await readFloats(`${side.view.name}/scans/${frame[i]}.bin`);
      if (this.shown.get(side) !== i) return;
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(new THREE.InterleavedBuffer(points, 4), 3, 0));
      side.scan.geometry.dispose();
      side.scan.geometry = geometry;
      side.scan.matrixAutoUpdate = false;
      side.scan.matrix.copy(toMatrix(pose[i]!));
      side.scan.visible = true;
      this.stage.draw();
    } catch (problem) {
      this.label.textContent = (problem as Error).message;
    }
  }
}

// SPDX-License-Identifier: Apache-2.0
// The drive in time: where the robot was, and what it saw then.
import * as THREE from "three";
import { h } from "./dom";
import { isReport, readFloats } from "./files";
import { frameName, toMatrix } from "./model";
import type { Side, Stage } from "./stage";

export class Timeline {
  readonly root: HTMLElement;
  private readonly input: HTMLInputElement;
  private readonly label = h("output", { id: "moment" });
  private readonly button: HTMLButtonElement;
  private playing = 0;
  private shown = -1;

  constructor(private readonly stage: Stage, private readonly side: Side) {
    const count = side.view.scans.frame.length;
    this.input = h("input", { type: "range", min: 0, max: Math.max(0, count - 1), value: 0, "aria-label": "Moment of the drive", input: () => this.show(this.input.valueAsNumber) });
    this.button = h("button", { type: "button", "aria-label": "Play the drive", click: () => this.toggle() }, "▶");
    this.root = h("div", { id: "timeline", hidden: count === 0 }, this.button, this.input, this.label);
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
      const { stamp_s } = this.side.view.scans, last = stamp_s.length - 1;
      if (this.input.valueAsNumber >= last) this.show(0);
      const steps = stamp_s.slice(1).map((t, i) => t - stamp_s[i]!).filter((t) => t > 0).sort((a, b) => a - b);
      const aScan_s = steps[Math.floor(steps.length / 2)] ?? 0.1, times = 10;  // as fast as it was driven
      const step = Math.max(1, Math.round((0.1 * times) / aScan_s));
      this.playing = window.setInterval(() => {
        if (this.input.valueAsNumber >= last) this.toggle();
        else this.show(Math.min(last, this.input.valueAsNumber + step));
      }, 100);
    }
    this.button.textContent = this.playing ? "❚❚" : "▶";
  }

  step(by: number) {
    this.show(Math.min(Number(this.input.max), Math.max(0, this.input.valueAsNumber + by)));
  }

  show(i: number) {
    const { frame, pose, stamp_s, keyframe } = this.side.view.scans;
    const at = pose[i];
    if (!at) return;
    this.input.value = String(i);
    this.label.textContent = `${(stamp_s[i]! - stamp_s[0]!).toFixed(1)} s, scan ${frameName(frame[i]!)}`;
    const T = toMatrix(at);
    this.side.robot.visible = true;
    this.side.robot.matrixAutoUpdate = false;
    this.side.robot.matrix.copy(T);
    this.stage.draw();
    let seen = i;  // points are kept of key frames
    while (seen > 0 && !keyframe[seen]) --seen;
    if (!isReport && seen !== this.shown) void this.showScan(seen);
  }

  private async showScan(i: number) {
    this.shown = i;
    const { frame, pose } = this.side.view.scans;
    try {
      const points = await readFloats(`${this.side.view.name}/scans/${frame[i]}.bin`);
      if (this.shown !== i) return;
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.InterleavedBufferAttribute(new THREE.InterleavedBuffer(points, 4), 3, 0));
      this.side.scan.geometry.dispose();
      this.side.scan.geometry = geometry;
      this.side.scan.matrixAutoUpdate = false;
      this.side.scan.matrix.copy(toMatrix(pose[i]!));
      this.side.scan.visible = true;
      this.stage.draw();
    } catch (problem) {
      this.label.textContent = (problem as Error).message;
    }
  }
}

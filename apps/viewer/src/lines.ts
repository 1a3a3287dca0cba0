// SPDX-License-Identifier: Apache-2.0
// Trajectories and loops as lines, a few pixels wide.
import * as THREE from "three";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import { colourAt, loopColour, ofFalse, ofOdometry, ofRefused, ofTruth } from "./colours";
import { positionOf, sessionOf, type Loop, type Triple, type View } from "./model";

const material = (width: number, options: object = {}) =>
  new LineMaterial({ linewidth: width, vertexColors: true, transparent: true, depthTest: false, ...options });

/** Lines a session; rows without a place are bridged. */
function paths(view: View, places: (Triple | number[] | null)[], colour: (at: number) => THREE.Color, width: number): THREE.Group {
  const group = new THREE.Group();
  const bySession = new Map<number, { points: number[]; colours: number[] }>();
  const count = Math.max(1, places.length - 1);
  places.forEach((place, i) => {
    if (!place) return;
    const session = sessionOf(view.scans.frame[i]!);
    const path = bySession.get(session) ?? { points: [], colours: [] };
    bySession.set(session, path);
    path.points.push(place[0]!, place[1]!, place[2]!);
    const c = colour(i / count);
    path.colours.push(c.r, c.g, c.b);
  });
  for (const { points, colours } of bySession.values()) {
    if (points.length < 6) continue;
    const geometry = new LineGeometry();
    geometry.setPositions(points);
    geometry.setColors(colours);
    const line = new Line2(geometry, material(width));
    line.renderOrder = 1;
    line.frustumCulled = false;
    group.add(line);
  }
  return group;
}

export class Trajectories {
  readonly after: THREE.Group;
  readonly before: THREE.Group;
  readonly truth: THREE.Group;

  constructor(view: View) {
    const plain = (style: string) => () => new THREE.Color(style);
    this.after = paths(view, view.scans.pose, (at) => colourAt("cividis", at), 3);
    this.before = paths(view, view.scans.odometry, plain(ofOdometry), 1.5);
    this.truth = paths(view, view.scans.truth, plain(ofTruth), 1.5);
    this.before.visible = false;
    this.truth.visible = false;
  }

  dispose() {
    for (const group of [this.after, this.before, this.truth])
      for (const line of group.children as Line2[]) {
        line.geometry.dispose();
        (line.material as LineMaterial).dispose();
      }
  }
}

export class LoopLines {
  readonly group = new THREE.Group();
  threshold = -Infinity;
  showRefused = false;
  shown: Loop[] = [];
  private selected: Loop | null = null;

  constructor(private view: View) {
    this.draw();
  }

  update(view: View) {
    this.view = view;
    this.draw();
  }

  select(loop: Loop | null) {
    this.selected = loop;
    this.draw();
  }

  colour(loop: Loop): THREE.Color {
    if (loop.accepted && loop.right === false) return new THREE.Color(ofFalse);
    if (!loop.accepted || loop.score < this.threshold) return new THREE.Color(ofRefused);
    return loopColour(loop.probability ?? 1);
  }

  draw() {
    for (const child of [...this.group.children] as LineSegments2[]) {
      child.geometry.dispose();
      (child.material as LineMaterial).dispose();
      this.group.remove(child);
    }
    this.shown = this.view.loops.filter((loop) => (loop.accepted || this.showRefused) &&
      positionOf(this.view, loop.query) && positionOf(this.view, loop.match));
    this.add(this.shown.filter((loop) => loop.right !== false || !loop.accepted), 1.5, 0.75);
    this.add(this.shown.filter((loop) => loop.right === false && loop.accepted), 5, 1);
    if (this.selected) this.add([this.selected], 6, 1);
  }

  private add(loops: Loop[], width: number, opacity: number) {
    const points: number[] = [], colours: number[] = [];
    for (const loop of loops) {
      const query = positionOf(this.view, loop.query), match = positionOf(this.view, loop.match);
      if (!query || !match) continue;
      const c = this.colour(loop);
      points.push(...query, ...match);
      colours.push(c.r, c.g, c.b, c.r, c.g, c.b);
    }
    if (points.length === 0) return;
    const geometry = new LineSegmentsGeometry();
    geometry.setPositions(points);
    geometry.setColors(colours);
    const lines = new LineSegments2(geometry, material(width, { opacity }));
    lines.renderOrder = 2;
    lines.frustumCulled = false;
    this.group.add(lines);
  }

  /** The loop whose line passes within `reach` pixels of a place on the canvas. */
  at(x: number, y: number, reach: number, toPixels: (place: Triple) => [number, number] | null): Loop | null {
    let best: Loop | null = null, least = reach;
    for (const loop of this.shown) {
      const a = toPixels(positionOf(this.view, loop.query)!), b = toPixels(positionOf(this.view, loop.match)!);
      if (!a || !b) continue;
      const dx = b[0] - a[0], dy = b[1] - a[1];
      const along = Math.min(1, Math.max(0, ((x - a[0]) * dx + (y - a[1]) * dy) / Math.max(1e-9, dx * dx + dy * dy)));
      const distance = Math.hypot(x - a[0] - along * dx, y - a[1] - along * dy);
      if (distance < least) [best, least] = [loop, distance];
    }
    return best;
  }
}

// SPDX-License-Identifier: Apache-2.0
// The map's points, streamed: 3D Tiles of glTF points with `_intensity` and `_labels` (docs/formats.md). While a map is
// made, which has no tiles yet, some points of each key frame, where it stands now.
import * as THREE from "three";
import { TilesRenderer } from "3d-tiles-renderer/three";
import { kinds, textureOf, type Scale } from "./colours";
import { isReport, read, readFloats } from "./files";
import { sessionOf, toMatrix, type View } from "./model";

export type ColourBy = "intensity" | "height" | "time" | "session";
export const scaleOf: Record<ColourBy, Scale | null> = { intensity: "grey", height: "viridis", time: "cividis", session: null };

export const most_points_drawn = 2_000_000;
const finest_px = 2;  // between points, on the screen
const points_a_scan = 1500, longest_s = 600;  // of a map in the making

const vertex = `
attribute float _intensity;
attribute vec4 _labels;
uniform int colourBy;
uniform float size, lowZ, highZ, brightness;
uniform vec2 heights;
uniform sampler2D scale;
uniform vec3 kinds[8];
varying vec3 colour;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * viewMatrix * world;
  gl_PointSize = size;
  if (world.z < lowZ || world.z > highZ) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  float at = colourBy == 0 ? 0.1 + 0.9 * _intensity * brightness
           : colourBy == 1 ? (world.z - heights.x) / (heights.y - heights.x)
                           : (_labels.z + 256.0 * _labels.w) / 65535.0;
  int kind = int(mod(_labels.y, 8.0));
  colour = colourBy == 3 ? kinds[kind] : texture2D(scale, vec2(clamp(at, 0.0, 1.0), 0.5)).rgb;
}`;
const fragment = `
varying vec3 colour;
void main() {
  if (dot(gl_PointCoord - 0.5, gl_PointCoord - 0.5) > 0.25) discard;
  gl_FragColor = vec4(colour, 1.0);
}`;

export class MapPoints {
  readonly group = new THREE.Group();
  readonly material = new THREE.ShaderMaterial({
    vertexShader: vertex, fragmentShader: fragment,
    uniforms: {
      colourBy: { value: 0 }, size: { value: 2 }, lowZ: { value: -1e9 }, highZ: { value: 1e9 }, brightness: { value: 1 },
      heights: { value: new THREE.Vector2(0, 10) }, scale: { value: textureOf("grey") },
      kinds: { value: kinds.map((hex) => new THREE.Color().setStyle(hex, "")) },
    },
  });
  private tiles: TilesRenderer | null = null;
  failure = "";
  private isAdapting = false;
  private hasTileset = false;
  private readonly scans = new Map<number, THREE.Points | null>();  // by key frame; null where it keeps no points
  private isReading = false;
  private view: View;
  onChange = () => {};

  constructor(view: View) {
    this.view = view;
    if (view.has_tiles) this.stream(view.name);
    else void this.follow(view);
  }

  private stream(view: string) {
    const tiles = new TilesRenderer(`${view}/tiles/tileset.json`);
    this.tiles = tiles;
    tiles.errorTarget = finest_px;
    tiles.registerPlugin({ name: "files", fetchData: (url: string) => read(isReport ? url.slice(url.lastIndexOf(`${view}/tiles/`)) : url) });
    tiles.addEventListener("load-model", ({ scene }: any) => {
      scene.traverse((object: THREE.Object3D) => {
        if (!(object instanceof THREE.Points)) return;
        object.material = this.material;
      });
      this.onChange();
    });
    tiles.addEventListener("load-error", ({ error, url }: any) => {
      this.hasTileset = true;  // or never will have
      const name = String(url ?? "").split("/").pop();
      if (isReport) return;  // finer tiles are not in it
      this.failure = `${name}: ${error?.message ?? error}`;
      this.onChange();
    });
    tiles.addEventListener("load-tileset", () => {
      this.hasTileset = true;
      this.onChange();
    });
    this.group.add(tiles.group);
  }

  colourBy(by: ColourBy) {
    const number = ["intensity", "height", "time", "session"].indexOf(by);
    this.material.uniforms.colourBy!.value = number;
    const scale = scaleOf[by];
    if (scale) this.material.uniforms.scale!.value = textureOf(scale);
  }

  /** Puts every key frame where it stands now, and reads those that are new. */
  async follow(view: View) {
    this.view = view;
    if (this.tiles || isReport) return;
    for (const [frame, scan] of this.scans) {
      const at = view.index.get(frame);
      if (scan && at !== undefined) scan.matrix.copy(toMatrix(view.scans.pose[at]!));
    }
    if (this.isReading) return;
    this.isReading = true;
    this.failure = "";
    for (let i = 0; i < this.view.scans.frame.length; ++i) {  // it may grow meanwhile
      if (!this.view.scans.keyframe[i] || this.scans.has(this.view.scans.frame[i]!)) continue;
      try {
        await this.readScan(i);
      } catch (problem) {  // once more with the next news
        this.failure = (problem as Error).message;
      }
    }
    this.isReading = false;
    this.onChange();
  }

  private async readScan(i: number) {
    const { frame, pose, stamp_s } = this.view.scans, number = frame[i]!;
    const all = await readFloats(`${this.view.name}/scans/${number}.bin`);
    const step = 4 * Math.max(1, Math.ceil(all.length / 4 / points_a_scan)), count = Math.floor(all.length / step);
    this.scans.set(number, null);
    if (count === 0) return;
    const place = new Float32Array(3 * count), intensity = new Float32Array(count), labels = new Uint8Array(4 * count);
    const time = Math.round(65535 * Math.min(1, Math.max(0, (stamp_s[i]! - stamp_s[0]!) / longest_s)));
    for (let k = 0; k < count; ++k) {
      place.set(all.subarray(k * step, k * step + 3), 3 * k);
      intensity[k] = all[k * step + 3]!;
      labels.set([0, sessionOf(number), time & 255, time >> 8], 4 * k);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(place, 3));
    geometry.setAttribute("_intensity", new THREE.BufferAttribute(intensity, 1));
    geometry.setAttribute("_labels", new THREE.BufferAttribute(labels, 4));
    const scan = new THREE.Points(geometry, this.material);
    scan.matrixAutoUpdate = false;
    scan.matrix.copy(toMatrix(pose[i]!));
    this.scans.set(number, scan);
    this.group.add(scan);
    this.onChange();
  }

  /** Loads what the camera wants; says how many points are drawn. */
  update(camera: THREE.Camera, renderer: THREE.WebGLRenderer, most = most_points_drawn): number {
    const tiles = this.tiles;
    if (!tiles) return this.drawnIn(this.group);
    tiles.setCamera(camera);
    tiles.setResolutionFromRenderer(camera, renderer);
    camera.updateMatrixWorld();
    tiles.update();
    const drawn = this.drawnIn(tiles.group);
    const before = tiles.errorTarget;
    if (drawn > most) tiles.errorTarget *= 1.2;
    else if (drawn < most / 2 && before > finest_px) tiles.errorTarget = Math.max(finest_px, before / 1.1);
    this.isAdapting = tiles.errorTarget !== before;
    return drawn;
  }

  private drawnIn(group: THREE.Object3D): number {
    let drawn = 0;
    group.traverseVisible((object: THREE.Object3D) => {
      if (object instanceof THREE.Points) drawn += object.geometry.getAttribute("position").count;
    });
    return drawn;
  }

  get isLoading(): boolean {
    if (!this.tiles) return this.isReading;
    const stats = (this.tiles as any)?.stats;
    return this.isAdapting || !this.hasTileset || (stats ? stats.downloading + stats.parsing > 0 : false);
  }

  dispose() {
    this.tiles?.dispose();
    this.material.dispose();
  }
}

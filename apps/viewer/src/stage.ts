// SPDX-License-Identifier: Apache-2.0
// The scenes of one or two views, side by side under one camera. Drawn when something changes, not all the time.
import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { LoopLines, Trajectories } from "./lines";
import type { Triple, View } from "./model";
import { MapPoints, most_points_drawn } from "./points";

export class Side {
  readonly scene = new THREE.Scene();
  trajectories: Trajectories;
  readonly loops: LoopLines;
  readonly points: MapPoints | null;
  readonly scan = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: 3, sizeAttenuation: false, color: "#e69f00" }));
  readonly robot = new THREE.Mesh(new THREE.ConeGeometry(1, 3, 12).rotateZ(-Math.PI / 2), new THREE.MeshBasicMaterial({ color: "#d55e00", depthTest: false }));

  constructor(public view: View) {
    this.trajectories = new Trajectories(view);
    this.loops = new LoopLines(view);
    this.points = view.has_tiles || view.command !== "detect" ? new MapPoints(view) : null;
    this.scan.frustumCulled = false;
    this.robot.renderOrder = 3;
    this.scan.visible = this.robot.visible = false;
    const { after, before, truth } = this.trajectories;
    this.scene.add(before, truth, after, this.loops.group, this.scan, this.robot);
    if (this.points) this.scene.add(this.points.group);
  }

  /** The same results, later: what is shown stays as it was chosen. */
  update(view: View) {
    this.view = view;
    const old = this.trajectories;
    this.trajectories = new Trajectories(view);
    for (const name of ["after", "before", "truth"] as const) {
      this.trajectories[name].visible = old[name].visible;
      this.scene.remove(old[name]);
      this.scene.add(this.trajectories[name]);
    }
    old.dispose();
    this.loops.update(view);
    void this.points?.follow(view);
  }
}

/** Whether the processor draws, and no graphics card: smoothed edges then cost much. */
function isDrawnInSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl && info ? String(gl.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly perspective = new THREE.PerspectiveCamera(50, 1, 0.5, 20000);
  readonly orthographic = new THREE.OrthographicCamera(-1, 1, 1, -1, -5000, 20000);
  camera: THREE.PerspectiveCamera | THREE.OrthographicCamera = this.perspective;
  readonly controls: OrbitControls;
  sides: Side[] = [];
  drawn = 0;
  onDraw = () => {};
  isMoved = false;  // by hand, or to a loop
  private isWaiting = false;
  private height = 0;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: !isDrawnInSoftware() });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    THREE.ColorManagement.enabled = true;
    this.orthographic.userData.half = 50;
    for (const camera of [this.perspective, this.orthographic]) camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.screenSpacePanning = false;
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => (this.isMoved = true));
    this.controls.listenToKeyEvents(canvas);
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  add(side: Side) {
    this.sides.push(side);
    if (side.points) side.points.onChange = () => this.draw();
    this.draw();
  }

  /** Of the first view's trajectory. */
  bounds(): THREE.Box3 {
    const box = new THREE.Box3();
    for (const side of this.sides)
      for (const pose of side.view.scans.pose) box.expandByPoint(new THREE.Vector3(pose[0], pose[1], pose[2]));
    if (box.isEmpty()) box.expandByPoint(new THREE.Vector3());
    return box.expandByScalar(15);
  }

  /** All of it: from above, or from a corner. */
  frame(fromAbove: boolean) {
    this.isMoved = false;
    const box = this.bounds(), middle = box.getCenter(new THREE.Vector3()), size = box.getSize(new THREE.Vector3());
    this.camera = fromAbove ? this.orthographic : this.perspective;
    this.controls.object = this.camera;
    this.controls.target.copy(middle);
    const aspect = this.aspect();
    if (fromAbove) {
      const half = 0.55 * Math.max(size.y, size.x / aspect, 10);
      this.orthographic.zoom = 1;
      this.orthographic.userData.half = half;
      this.orthographic.position.copy(middle).add(new THREE.Vector3(0, -0.001, 1000));
    } else {
      const distance = 0.62 * Math.max(size.y, size.x / aspect, 20) / Math.tan((0.5 * 50 * Math.PI) / 180);
      this.perspective.position.copy(middle).add(new THREE.Vector3(-0.35, -0.65, 0.7).normalize().multiplyScalar(distance * 1.15));
    }
    this.controls.enableRotate = !fromAbove;
    this.controls.update();
    this.draw();
  }

  lookAt(place: Triple) {
    const target = new THREE.Vector3(...place);
    this.isMoved = true;
    this.camera.position.add(target.clone().sub(this.controls.target));
    this.controls.target.copy(target);
    this.controls.update();
    this.draw();
  }

  private aspect(): number {
    const { clientWidth, clientHeight } = this.canvas;
    return Math.max(0.1, clientWidth / Math.max(1, this.sides.length) / Math.max(1, clientHeight));
  }

  toPixels(place: Triple, side = 0): [number, number] | null {
    const p = new THREE.Vector3(...place).project(this.camera);
    if (p.z < -1 || p.z > 1) return null;
    const width = this.canvas.clientWidth / Math.max(1, this.sides.length);
    return [side * width + (0.5 + 0.5 * p.x) * width, (0.5 - 0.5 * p.y) * this.canvas.clientHeight];
  }

  /** The point of the map under a place on the canvas. */
  pick(x: number, y: number): THREE.Vector3 | null {
    const width = this.canvas.clientWidth / Math.max(1, this.sides.length);
    const side = this.sides[Math.floor(x / width)];
    if (!side?.points) return null;
    const ray = new THREE.Raycaster();
    ray.params.Points.threshold = Math.max(0.2, 4 * this.metresAPixel());
    ray.setFromCamera(new THREE.Vector2(2 * ((x % width) / width) - 1, 1 - (2 * y) / this.canvas.clientHeight), this.camera);
    const { lowZ, highZ } = side.points.material.uniforms;
    const hits = ray.intersectObject(side.points.group, true);  // the nearest first
    return hits.find(({ point }) => point.z >= lowZ!.value && point.z <= highZ!.value)?.point ?? null;
  }

  /** At the target. */
  metresAPixel(): number {
    const height = Math.max(1, this.canvas.clientHeight);
    if (this.camera === this.orthographic) return (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom / height;
    const distance = this.camera.position.distanceTo(this.controls.target);
    return (2 * distance * Math.tan((0.5 * this.perspective.fov * Math.PI) / 180)) / height;
  }

  draw() {
    if (this.isWaiting) return;
    this.isWaiting = true;
    requestAnimationFrame(() => {
      this.isWaiting = false;
      this.drawNow();
      if (this.sides.some((side) => side.points?.isLoading)) setTimeout(() => this.draw(), 50);
    });
  }

  private drawNow() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    if (this.height > 0) this.orthographic.userData.half *= height / this.height;  // more is seen, not larger
    this.height = height;
    const aspect = this.aspect(), half = this.orthographic.userData.half;
    this.perspective.aspect = aspect;
    this.perspective.updateProjectionMatrix();
    Object.assign(this.orthographic, { left: -half * aspect, right: half * aspect, top: half, bottom: -half });
    this.orthographic.updateProjectionMatrix();
    const part = width / Math.max(1, this.sides.length);
    const background = getComputedStyle(this.canvas).getPropertyValue("--stage").trim() || "#101419";
    this.renderer.setScissorTest(true);
    this.drawn = 0;
    this.sides.forEach((side, i) => {
      this.renderer.setViewport(i * part, 0, part, height);
      this.renderer.setScissor(i * part, 0, part, height);
      this.renderer.setClearColor(background);
      if (side.points) this.drawn += side.points.update(this.camera, this.renderer, most_points_drawn / this.sides.length);
      this.renderer.clear();
      this.renderer.render(side.scene, this.camera);
    });
    this.onDraw();
  }
}

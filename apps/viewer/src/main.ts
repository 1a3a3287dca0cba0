// SPDX-License-Identifier: Apache-2.0
import "./style.css";
import { chartsTab } from "./charts_tab";
import { h } from "./dom";
import { isReport, readJson } from "./files";
import { LoopTab } from "./loop_tab";
import { MapTab } from "./map_tab";
import { positionOf, toView, type Loop, type Triple, type View } from "./model";
import type { ColourBy } from "./points";
import { Side, Stage } from "./stage";
import { Timeline } from "./timeline";

const app = document.getElementById("app")!;

function heightsOf(view: View): [number, number] {
  const z = view.scans.pose.map((pose) => pose[2]!).sort((a, b) => a - b);
  return z.length > 0 ? [z[0]! - 3, z.at(-1)! + 10] : [0, 10];
}

/** A round length that is about a fifth of the picture. */
function showScale(element: HTMLElement, metresAPixel: number) {
  const most = 160 * metresAPixel, power = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((f) => f * power).find((length) => length <= most) ?? power;
  element.style.width = `${metres / metresAPixel}px`;
  element.textContent = metres >= 1000 ? `${metres / 1000} km` : `${metres} m`;
}

function summaryOf(view: View): string {
  const accepted = view.loops.filter((loop) => loop.accepted), wrong = accepted.filter((loop) => loop.right === false);
  return `${view.scans.frame.length} scans, ${accepted.length} loops` + (view.has_truth ? `, ${wrong.length} of them false` : "") +
    (view.run.interrupted ? "; interrupted" : "");
}

function start(views: View[]) {
  const canvas = h("canvas", { id: "stage", tabindex: 0, "aria-label": "The map in three dimensions" });
  const notice = h("p", { id: "notice", role: "status", hidden: true });
  const scale = h("div", { id: "scale" }), north_deg = views[0]!.north_deg;
  const up = h("div", { id: "up", title: north_deg === undefined ? "The map's y axis" : "North" }, north_deg === undefined ? "y" : "N");
  const stageBox = h("main", {}, canvas, scale, up, notice);
  app.replaceChildren(stageBox);
  const stage = new Stage(canvas);
  for (const view of views) stage.add(new Side(view));
  const first = () => stage.sides[0]!;
  const view = views[0]!;

  let selected: Loop | null = null, walked: Side | null = null;  // the keys go through the loops of the side clicked last
  const loopTab = new LoopTab((by) => step(by));
  const select = (loop: Loop | null, side = first()) => {
    selected = loop;
    if (loop) walked = side;
    for (const each of stage.sides) each.loops.select(each === side ? loop : null);
    loopTab.show(side.view, loop);
    if (loop) tabs.show("Loop");
    stage.draw();
  };
  const step = (by: number) => {
    const side = walked ?? first();
    const loops = side.loops.shown.length > 0 ? side.loops.shown : side.view.loops.filter((l) => l.accepted || side.loops.showRefused);
    if (loops.length === 0) return;
    const at = selected ? loops.indexOf(selected) : by > 0 ? -1 : 0;
    const loop = loops[(at + by + loops.length) % loops.length]!;
    const place = positionOf(side.view, loop.query);
    if (place) stage.lookAt(place);
    select(loop, side);
  };

  const heights = heightsOf(view);
  const mapTab = new MapTab(stage, view, heights);
  for (const side of stage.sides) side.points?.material.uniforms.heights!.value.set(...heights);
  const charts = h("div", {}, ...stage.sides.flatMap((side) => [
    stage.sides.length > 1 ? h("h2", { class: "tab" }, side.view.title) : null,
    chartsTab(side.view, (score) => {
      side.loops.threshold = score;
      side.loops.draw();
      stage.draw();
    })].filter((part) => part !== null)));
  const tabs = makeTabs({ Map: mapTab.root, Loop: loopTab.root, Charts: charts });
  const timeline = new Timeline(stage);
  const title = views.map((each) => each.title).join("   |   ");
  const summary = h("p", {}, summaryOf(view));
  const header = h("header", {}, h("h1", {}, title), summary);
  app.replaceChildren(header, stageBox, tabs.root, timeline.root);

  const problems = views.flatMap((each) => each.problems);
  const say = (text: string) => {
    notice.textContent = [text, ...problems].filter((part) => part !== "").join(" · ");
    notice.hidden = notice.textContent === "";
  };
  say("");
  stage.onDraw = () => {
    showScale(scale, stage.metresAPixel());
    up.style.transform = `rotate(${stage.controls.getAzimuthalAngle() - ((north_deg ?? 0) * Math.PI) / 180}rad)`;
    mapTab.status.textContent = `${stage.drawn.toLocaleString("en")} points drawn`;
    const failure = stage.sides.map((side) => side.points?.failure).find((text) => text);
    if (failure) say(`A part of the map cannot be shown: ${failure}`);
    canvas.dataset.drawn = String(stage.drawn);
    canvas.dataset.loading = String(stage.sides.some((side) => side.points?.isLoading));
  };
  const noTiles = view.command === "detect" ? "No points: revisit slam makes a map." : "The map so far, thinned; all points come with the finished map.";
  if (!view.has_tiles) say(noTiles);
  if (view.scans.frame.length === 0)
    say(view.command === "detect" ? "No trajectory: these results have no poses. The charts show which scans met." : "No scan yet: the run has just begun.");

  let pressed: [number, number] = [0, 0], measured: Triple | null = null;
  canvas.addEventListener("pointerdown", (event) => (pressed = [event.offsetX, event.offsetY]));
  canvas.addEventListener("click", (event) => {
    const { offsetX: x, offsetY: y } = event;
    if (Math.hypot(x - pressed[0], y - pressed[1]) > 5) return;
    if (mapTab.isMeasuring) {
      const point = stage.pick(x, y)?.toArray() as Triple | undefined;
      if (!point) return void (mapTab.measured.textContent = "No point there.");
      const [dx, dy, dz] = measured ? [0, 1, 2].map((i) => point[i]! - measured![i]!) as Triple : [0, 0, 0];
      mapTab.measured.textContent = measured
        ? `${Math.hypot(dx, dy, dz).toFixed(2)} m apart; ${Math.hypot(dx, dy).toFixed(2)} m on the ground, ${dz.toFixed(2)} m in height`
        : `${point.map((v) => v.toFixed(2)).join(", ")} m; now the other one`;
      measured = measured ? null : point;
      return;
    }
    stage.sides.forEach((side, i) => {
      const found = side.loops.group.visible ? side.loops.at(x, y, 12, (place) => stage.toPixels(place, i)) : null;
      if (found) select(found, side);
    });
  });
  addEventListener("keydown", (event) => {
    if (event.target instanceof HTMLSelectElement || event.ctrlKey || event.metaKey || event.altKey) return;
    const colours: Record<string, ColourBy> = { "1": "intensity", "2": "height", "3": "time", "4": "session" };
    if (colours[event.key]) mapTab.colourBy(colours[event.key]!);
    else if (event.key === "n") step(1);
    else if (event.key === "p") step(-1);
    else if (event.key === "t") stage.frame(true);
    else if (event.key === "c") stage.frame(false);
    else if (event.key === "," || event.key === ".") timeline.step(event.key === "." ? 1 : -1);
    else if (event.key === " " && !(event.target instanceof HTMLButtonElement || event.target instanceof HTMLInputElement)) timeline.toggle();
    else if (event.key === "Escape") select(null);
    else return;
    event.preventDefault();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => stage.draw());
  stage.frame(view.scans.frame.length > 0);
  if (!isReport) listen(stage, say, (now) => {
    summary.textContent = summaryOf(now);
    timeline.update();
    mapTab.update(now);
    if (now.scans.frame.length > 0) say(now.has_tiles ? "" : noTiles);
  });
}

/** While a map is made its trajectory and loops are read anew. */
function listen(stage: Stage, say: (text: string) => void, update: (view: View) => void) {
  const events = new EventSource("events");
  let isReading = false, isOld = false;
  const read = async () => {
    try {
      for (const side of stage.sides) {
        const name = side.view.name, view = toView(name, await readJson(`${name}/view.json`));
        const isFirst = side.view.scans.frame.length === 0 && view.scans.frame.length > 0;
        if (isFirst || view.has_tiles !== side.view.has_tiles) return location.reload();  // what can be shown has changed
        side.update(view);
        if (!stage.isMoved) stage.frame(stage.camera === stage.orthographic);  // all of it, while nobody looks elsewhere
      }
      update(stage.sides[0]!.view);
      stage.draw();
    } catch (problem) {
      say((problem as Error).message);
    }
  };
  events.onmessage = async () => {  // one after the other, and the last one always
    if (isReading) return void (isOld = true);
    isReading = true;
    do {
      isOld = false;
      await read();
    } while (isOld);
    isReading = false;
  };
}

function makeTabs(bodies: Record<string, HTMLElement>) {
  const buttons = new Map<string, HTMLElement>();
  const show = (name: string) => {
    for (const [each, body] of Object.entries(bodies)) {
      body.hidden = each !== name;
      buttons.get(each)!.setAttribute("aria-selected", String(each === name));
    }
  };
  const bar = h("div", { role: "tablist" });
  for (const name of Object.keys(bodies)) {
    const button = h("button", { type: "button", role: "tab", click: () => {
      root.classList.remove("closed");
      show(name);
    } }, name);
    buttons.set(name, button);
    bar.append(button);
  }
  const close = h("button", { type: "button", class: "close", "aria-label": "Hide or show the panel", click: () => root.classList.toggle("closed") }, "▾");
  bar.append(close);
  const root = h("aside", {}, bar, ...Object.values(bodies));
  show(Object.keys(bodies)[0]!);
  return { root, show };
}

try {
  const { views } = await readJson("views.json");
  start(await Promise.all(["a", "b"].slice(0, views).map(async (name) => toView(name, await readJson(`${name}/view.json`)))));
} catch (problem) {
  app.replaceChildren(h("p", { id: "notice", role: "alert" }, `These results cannot be shown: ${(problem as Error).message}`));
}

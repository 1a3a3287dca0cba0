// SPDX-License-Identifier: Apache-2.0
// The page in a real browser: every view and every control.
import assert from "node:assert/strict";
import { cpSync, mkdirSync, readFileSync, rmSync, truncateSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { after, test as add } from "node:test";
import { browserIsMissing, close, looksLike, open, settle } from "./page.mjs";
import { revisit, serve, slam, start, stopAll, work } from "./server.mjs";
import { writeTileset } from "./big_tileset.mjs";

const test = (name, body) => add(name, { skip: browserIsMissing }, body);
after(async () => {
  stopAll();
  await close();
  rmSync(work, { recursive: true, force: true });
});
let loop;
const results = () => {
  if (!loop) {
    loop = slam("loop");
    revisit("evaluate", loop.out, "--reference", loop.drive);
  }
  return loop.out;
};
const text = (page, selector) => page.locator(selector).innerText();
/** Until the text there is so: what is read in the background is shown when it has come. */
async function shows(page, selector, pattern) {
  const until = Date.now() + 20_000;
  while (Date.now() < until && !pattern.test(await text(page, selector))) await page.waitForTimeout(50);
  assert.match(await text(page, selector), pattern);
}
const check = (page, label) => page.locator(".check").filter({ has: page.getByText(new RegExp(`^${label}`)) }).locator("input");
const slide = (page, label, value) => page.locator(".row", { hasText: label }).locator("input").fill(String(value));

test("the map is drawn, from above and from a corner", async (context) => {
  const page = await open(context, await serve(context, results()));
  assert.ok((await settle(page)) > 20_000);
  await shows(page, "header", /scans, \d+ loops, 0 of them false/);
  await looksLike(page, "map_above");
  await page.getByText("From a corner").click();
  await settle(page);
  await looksLike(page, "map_corner");
  await page.getByText("From above").click();
  await settle(page);
  await looksLike(page, "map_above");
  assert.deepEqual(page.problems, []);
});

test("every key does what its button does", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  for (const [key, by] of [["1", "intensity"], ["3", "time"], ["4", "session"], ["2", "height"]]) {
    await page.keyboard.press(key);
    assert.equal(await page.locator("select").inputValue(), by);
  }
  await page.keyboard.press("c");
  await settle(page);
  await looksLike(page, "map_corner");
  await page.keyboard.press("t");
  await settle(page);
  await looksLike(page, "map_above");
  await page.keyboard.press("n");
  const first = await text(page, "h2");
  await page.keyboard.press("n");
  assert.notEqual(await text(page, "h2"), first);
  await page.keyboard.press("p");
  assert.equal(await text(page, "h2"), first);
  const button = page.getByLabel("Play the drive");
  for (const sign of ["❚❚", "▶"]) {
    await page.keyboard.press(" ");
    assert.equal(await button.innerText(), sign);
  }
  await page.keyboard.press(".");
  const moment = await text(page, "#moment");
  await page.keyboard.press(".");
  assert.notEqual(await text(page, "#moment"), moment);
  await page.keyboard.press(",");
  assert.equal(await text(page, "#moment"), moment);
  assert.deepEqual(page.problems, []);
});

test("every control of the map changes the picture", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  let before = await page.locator("#stage").screenshot();
  const changes = async (what, act) => {
    await act();
    await settle(page);
    const now = await page.locator("#stage").screenshot();
    assert.ok(!now.equals(before), what);
    before = now;
  };
  for (const by of ["intensity", "time", "session", "height"])
    await changes(by, () => page.locator("select").selectOption(by));
  await changes("size", () => slide(page, "Point size", 6));
  await changes("lowest", () => slide(page, "Lowest shown", 1));
  await changes("highest", () => slide(page, "Highest shown", 3));
  for (const name of ["Points", "Trajectory, coloured", "Odometry, before", "Truth", "Loops, coloured"])
    await changes(name, () => check(page, name).click());
  await changes("loops again", () => check(page, "Loops, coloured").click());
  await changes("refused", () => check(page, "Refused").click());
  await changes("wheel", async () => (await page.locator("#stage").hover(), page.mouse.wheel(0, -600)));
  await changes("intensity and brightness", async () => {
    await check(page, "Points").click();
    await page.keyboard.press("Escape");
    await page.locator("select").selectOption("intensity");
    await slide(page, "Brightness", 3);
  });
  assert.deepEqual(page.problems, []);
});

test("a loop shows both scans, both descriptors and the evidence", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  await page.keyboard.press("n");
  await page.locator("figure").nth(1).waitFor();
  await shows(page, "aside", /Right: [\d.]+ m and [\d.]+° from the truth/);
  await shows(page, "aside", /free space\s+0\.\d\d/);
  assert.equal(await page.locator("canvas.picture").count(), 4);
  await looksLike(page, "loop");
  const first = await text(page, "h2");
  await page.getByText("Next ▶").click();
  assert.notEqual(await text(page, "h2"), first);
  await page.getByText("◀ Previous").click();
  assert.equal(await text(page, "h2"), first);
  const picture = page.locator("canvas.picture").first();
  await picture.waitFor();
  const before = await picture.screenshot();
  await check(page, "This scan at its true pose").click();
  assert.ok(!(await picture.screenshot()).equals(before), "the scan at its true pose is drawn, too");
  assert.deepEqual(page.problems, []);
});

test("a refused candidate says why", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  await check(page, "Refused").click();
  const { loops } = JSON.parse(await page.evaluate(async () => (await fetch("a/view.json")).text()));
  for (const loop of loops) {
    await page.keyboard.press("n");
    if (!loop.accepted) break;
  }
  await shows(page, "aside", /Refused: \S+/);
  assert.ok(loops.some((loop) => !loop.accepted && loop.reason));
});

test("false loops stand out, in the map and by name", async (context) => {
  const wrong = join(work, "wrong");
  cpSync(results(), wrong, { recursive: true });
  const rows = readFileSync(join(wrong, "reference.txt"), "utf8").trim().split("\n");  // of the way back: 30 m beside
  const moved = rows.map((row, i) => row.split(" ").map((value, k) => (k === 7 && i > rows.length / 2 ? Number(value) + 30 : value)).join(" "));
  writeFileSync(join(wrong, "reference.txt"), moved.join("\n") + "\n");
  const page = await open(context, await serve(context, wrong));
  await settle(page);
  await shows(page, "header", /, [1-9]\d* of them false/);
  await looksLike(page, "false_loops");
  await page.keyboard.press("n");
  await shows(page, "aside", /False loop: its pose is [\d.]+ m and [\d.]+° from the truth/);
  assert.deepEqual(page.problems, []);
});

test("a loop's line can be clicked, and touched", async (context) => {
  const page = await open(context, await serve(context, results()), { hasTouch: true });
  await settle(page);
  await page.keyboard.press("n");  // its line is in the middle now
  await page.keyboard.press("Escape");
  const box = await page.locator("#stage").boundingBox();
  await page.touchscreen.tap(box.x + box.width / 2, box.y + box.height / 2);
  await page.locator("h2").waitFor();
  await shows(page, "h2", /Scan \d+ → \d+/);
});

test("charts have titles and units, and the threshold recolours the loops", async (context) => {
  const page = await open(context, await serve(context, results()));
  await page.getByRole("tab", { name: "Charts" }).click();
  const titles = await page.locator("svg.chart .title").allTextContents();
  for (const part of ["Precision and recall", "Probability", "Reliability", "Distance from the truth", "odometry alone", "Which scans met"])
    assert.ok(titles.some((title) => title.includes(part)), part);
  for (const axis of await page.locator("svg.chart").all()) assert.equal(await axis.locator(".axis").count(), 2);
  await shows(page, "aside", /ms/);
  await settle(page);
  const before = await page.locator("#stage").screenshot();
  await page.locator(".row", { hasText: "Answers taken" }).locator("input").fill("5");
  await settle(page);
  assert.ok(!(await page.locator("#stage").screenshot()).equals(before));
  await looksLike(page, "charts");
});

test("the drive plays", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  const moment = async () => parseFloat(await text(page, "#moment"));
  const begin_ms = performance.now();
  await page.getByLabel("Play the drive").click();
  for (let i = 0; i < 300 && !((await moment()) > 3); ++i) await page.waitForTimeout(100);
  await page.getByLabel("Play the drive").click();
  const seconds = await moment(), most_s = (10 * (performance.now() - begin_ms)) / 1000;
  assert.ok(seconds > 3 && seconds <= most_s, `at most ten times as fast as driven: ${seconds} of ${most_s} s`);
  await page.keyboard.press("Escape");
  await page.keyboard.press(".");
  assert.notEqual(parseFloat(await text(page, "#moment")), seconds);
  await page.getByLabel("Moment of the drive").fill("40");
  await shows(page, "#moment", /s, scan 40$/);
  await settle(page);
  await looksLike(page, "moment");
});

test("two points are measured", async (context) => {
  const page = await open(context, await serve(context, results()));
  await settle(page);
  await check(page, "Measure").click();
  const box = await page.locator("#stage").boundingBox();
  const click = async (from) => {  // some point there
    for (let i = from; i < box.width; i += 7) {
      await page.mouse.click(box.x + i, box.y + 0.45 * box.height);
      if (!(await text(page, "#measured")).includes("No point")) return;
    }
  };
  await click(60);
  await click(250);
  await shows(page, "#measured", /[\d.]+ m apart; [\d.]+ m on the ground/);
});

test("it fits a telephone, and a large screen in the dark", async (context) => {
  const address = await serve(context, results());
  const small = await open(context, address, { viewport: { width: 360, height: 740 } });
  await settle(small);
  assert.equal(await small.evaluate(() => document.documentElement.scrollWidth), 360);
  await small.getByLabel("Hide or show the panel").click();
  await settle(small);
  await looksLike(small, "telephone");
  const large = await open(context, address, { viewport: { width: 3840, height: 2160 }, colorScheme: "dark" });
  assert.equal(await large.evaluate(() => getComputedStyle(document.querySelector("aside")).backgroundColor), "rgb(24, 28, 34)");
});

test("a map of two sessions has a colour for each, from the map alone", async (context) => {
  const { out } = slam("two", { length_m: 90 });
  slam("two_b", { length_m: 90, day: 2 }, ["--into", out]);
  mkdirSync(join(work, "alone"));
  cpSync(join(out, "map.revisit"), join(work, "alone", "home.revisit"));
  const page = await open(context, await serve(context, join(work, "alone", "home.revisit")));
  await page.locator("select").selectOption("session");
  assert.ok((await settle(page)) > 10_000);
  await shows(page, "aside", /session 0: two\.toml[\s\S]*session 1: two_b\.toml/);
  await looksLike(page, "sessions");
  const shared = await open(context, await serve(context, out));
  await settle(shared);
  const { loops } = JSON.parse(await shared.evaluate(async () => (await fetch("a/view.json")).text()));
  const across = loops.findIndex((loop) => loop.accepted && loop.query >= 2 ** 40 && loop.match < 2 ** 40);
  assert.ok(across >= 0, "the second session was found in the first");
  assert.ok(loops[across].evidence.free_space_agreement > 0.5);
  const { out: other } = slam("two_c", { length_m: 90, day: 3 }), all = join(work, "all.revisit");
  revisit("merge", out, other, "--out", all);
  const merged = await open(context, await serve(context, all));
  const found = JSON.parse(await merged.evaluate(async () => (await fetch("a/view.json")).text())).loops.filter((loop) => loop.accepted);
  for (const session of [1, 2]) {  // what the first map knew, and what merging found
    const of = found.filter((loop) => Math.floor(loop.query / 2 ** 40) === session && Math.floor(loop.match / 2 ** 40) !== session);
    assert.ok(of.length > 0 && of.every((loop) => loop.evidence.free_space_agreement > 0.5), `session ${session}`);
  }
  assert.deepEqual(page.problems, []);
});

test("a run without loops, and one without poses, say so", async (context) => {
  const { out } = slam("short", { length_m: 60 });
  const page = await open(context, await serve(context, out));
  await settle(page);
  await shows(page, "header", /, 0 loops/);
  await page.getByRole("tab", { name: "Loop" }).click();
  await page.getByText("Next ▶").click();
  const bare = join(work, "bare");
  mkdirSync(bare);
  writeFileSync(join(bare, "candidates.csv"), "query,match,score,accepted,reason\n60,1,0.9,1,\n61,,0,0,no similar place\n");
  writeFileSync(join(bare, "loops.csv"), "query,match,score,tx,ty,tz,qx,qy,qz,qw,inlier_ratio,rmse_m\n60,1,0.9,1,0,0,0,0,0,1,0.8,0.1\n");
  const none = await open(context, await serve(context, bare));
  await shows(none, "#notice", /No trajectory/);
  await none.getByRole("tab", { name: "Charts" }).click();
  await shows(none, "aside", /Which scans met/);
  assert.deepEqual(page.problems, []);
});

test("hostile and broken files are shown as what they are", async (context) => {
  const bad = join(work, "bad");
  cpSync(results(), bad, { recursive: true });
  const evil = '<img src=x onerror="document.title=1">';
  const rows = readFileSync(join(bad, "evidence.csv"), "utf8").split("\n");
  writeFileSync(join(bad, "evidence.csv"), [rows[0], `0,1,${evil}`, "1e999,nan,,,", ...rows.slice(1)].join("\n"));
  writeFileSync(join(bad, "run.json"), JSON.stringify({ command: "slam", input: evil, version: evil, counts: { [evil]: 1 }, ms_per_scan: { [evil]: 1 } }));
  writeFileSync(join(bad, "run.json"), JSON.stringify({ command: "slam", input: evil, version: evil, interrupted: evil, counts: { [evil]: 1, bad: evil }, ms_per_scan: { [evil]: 1, detect: null } }));
  truncateSync(join(bad, "tiles", "1_0_0_0.glb"), 60);
  const page = await open(context, await serve(context, bad));
  await settle(page);
  await shows(page, "#notice", /A part of the map cannot be shown: 1_0_0_0\.glb/);
  await shows(page, "#notice", /evidence\.csv:3: no numbers of two frames \(1 such rows\)/);
  await page.getByRole("tab", { name: "Charts" }).click();
  assert.ok((await text(page, "aside")).includes("<img"));
  assert.equal(await page.locator("aside img").count(), 0);
  assert.equal(await page.title(), "revisit");
  writeFileSync(join(bad, "run.json"), "{");
  writeFileSync(join(bad, "tiles", "tileset.json"), "{");
  const blank = await open(context, await serve(context, bad));
  await shows(blank, "#notice", /cannot be shown/);
  await shows(blank, "#notice", /run\.json: is no JSON object/);
});

test("two results stand side by side under one camera", async (context) => {
  const { out } = slam("other", { length_m: 150 });
  const page = await open(context, await serve(context, results(), "--compare", out));
  await settle(page);
  await shows(page, "h1", /loop\s+\|\s+.*other/);
  await looksLike(page, "compare");
  assert.deepEqual(page.problems, []);
});

test("of two results, the keys go through the loops of the side that was clicked", async (context) => {
  const { out } = slam("without", { length_m: 60 });
  const page = await open(context, await serve(context, out, "--compare", results()));
  await settle(page);
  const { loops } = JSON.parse(await page.evaluate(async () => (await fetch("b/view.json")).text()));
  const names = loops.filter((loop) => loop.accepted).map((loop) => `Scan ${loop.query} → ${loop.match}`);
  const box = await page.locator("#stage").boundingBox();
  const isOpen = () => page.locator("h2", { hasText: "Scan" }).isVisible();
  for (let y = 10; y < box.height && !(await isOpen()); y += 15)
    for (let x = box.width / 2 + 10; x < box.width && !(await isOpen()); x += 15) await page.mouse.click(box.x + x, box.y + y);
  const scan = () => page.locator("h2", { hasText: "Scan" }).innerText();
  const clicked = names.indexOf(await scan());
  assert.ok(clicked >= 0);
  await page.keyboard.press("n");
  assert.equal(await scan(), names[(clicked + 1) % names.length]);
});

test("a report is one file that needs no server", async (context) => {
  const file = join(work, "report.html");
  revisit("view", results(), "--report", file, "--report-mb", "4");
  const page = await open(context, `file://${file}`);
  assert.ok((await settle(page)) > 5_000);
  await page.keyboard.press("n");
  await shows(page, "aside", /Evidence/);
  await page.locator("figure").nth(1).waitFor();
  assert.equal(await page.locator("canvas.picture").count(), 4, "both scans and both descriptors");
  assert.deepEqual(page.problems, []);
});

test("it grows while slam works, then shows the points, and nothing is lost when it is closed", async (context) => {
  const { drive } = slam("template", { length_m: 60 });
  const long = join(work, "long.toml");
  writeFileSync(long, readFileSync(drive, "utf8").replace("length_m = 60", "length_m = 250"));
  const out = join(work, "live"), { address, child } = await start("slam", long, "--out", out, "--checkpoint-s", "0.3", "--view");
  const page = await open(context, "about:blank");
  let asked = 0;
  await page.route("**/view.json", async (route) => {  // at first the run has just begun
    const response = await route.fetch();
    if (asked++ > 0) return route.fulfill({ response });
    const view = await response.json();
    for (const each of Object.values(view.scans)) each.length = 0;
    await route.fulfill({ response, json: { ...view, loops: [] } });
  });
  await page.goto(address);
  await shows(page, "header p", /^0 scans/);
  const scans = async () => Number((await text(page, "header p")).match(/(\d+) scans/)[1]);
  const grows = async (first) => {
    for (const until = Date.now() + 60_000; Date.now() < until && (await scans()) <= first;) await page.waitForTimeout(100);
    assert.ok((await scans()) > first);
  };
  await grows(0);
  await grows(await scans());
  const isFinished = async () => JSON.parse(await (await fetch(`${address}a/view.json`)).text()).has_tiles;
  let early = 0, hasTiles = false;
  for (const until = Date.now() + 60_000; Date.now() < until && early === 0 && !hasTiles;) {
    hasTiles = await isFinished();
    early = await page.evaluate(() => Number(document.getElementById("stage").dataset.drawn));
  }
  assert.ok(early > 0 && !hasTiles, "points of key frames are there before the map is");
  await page.locator(".check", { hasText: "Odometry, before" }).locator("input").click();
  for (const until = Date.now() + 120_000; Date.now() < until && !(await isFinished());) await page.waitForTimeout(200);
  let drawn = 0;
  for (const until = Date.now() + 60_000; Date.now() < until && drawn < 10_000;) drawn = await settle(page);
  assert.ok(drawn > 10_000, "the page shows the map once it is there");
  await page.close();
  child.kill("SIGINT");
  assert.equal(await new Promise((resolve) => child.on("exit", resolve)), 0);
  assert.ok(readFileSync(join(out, "poses.tum"), "utf8").split("\n").length > 125);
});

test("ten million points are streamed, not loaded", async (context) => {
  const big = join(work, "big");
  cpSync(results(), big, { recursive: true });
  const files = writeTileset(join(big, "tiles"), 10_000_000);
  const page = await open(context, "about:blank");
  let requests = 0;
  page.on("request", (request) => (requests += request.url().endsWith(".glb") ? 1 : 0));
  await page.goto(await serve(context, big));
  let drawn = 0;
  for (const until = Date.now() + 60_000; Date.now() < until && drawn === 0;) drawn = await settle(page);
  assert.ok(drawn > 0 && drawn <= 2_000_000, `${drawn} drawn`);
  assert.ok(requests > 0 && requests < files / 2, `${requests} of ${files} tiles`);
});

// SPDX-License-Identifier: Apache-2.0
// The server of `revisit view`: what it gives, and what it does not.
import assert from "node:assert/strict";
import { cpSync, mkdirSync, readdirSync, readFileSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { join } from "node:path";
import { after, test } from "node:test";
import validator from "gltf-validator";
import { revisit, serve, slam, start, stopAll, work } from "./server.mjs";

after(() => {
  stopAll();
  rmSync(work, { recursive: true, force: true });
});
const { drive, out } = slam("loop");
revisit("evaluate", out, "--reference", drive);

/** What comes back for bytes as they are; fetch() would make a path proper first. */
function raw(address, bytes, wait_ms = 8000) {
  const { hostname, port } = new URL(address);
  return new Promise((resolve) => {
    let text = "";
    const socket = connect(Number(port), hostname, () => socket.write(bytes));
    socket.on("data", (data) => (text += data));
    socket.on("close", () => resolve(text));
    socket.on("error", () => resolve(text));
    setTimeout(() => (socket.destroy(), resolve(text)), wait_ms);
  });
}
const get = (address, path, head = "") => raw(address, `GET ${path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n${head}\r\n`);

test("view.json has the trajectory, the loops with their evidence, and the truth", async (context) => {
  const address = await serve(context, out);
  const view = await (await fetch(`${address}a/view.json`)).json();
  assert.equal(view.format, "revisit view");
  assert.equal(view.scans.frame.length, view.scans.pose.length);
  assert.ok(view.scans.frame.length > 300);
  assert.ok(view.scans.truth.every((place, i) => Math.hypot(place[0] - view.scans.pose[i][0], place[1] - view.scans.pose[i][1]) < 1));
  const accepted = view.loops.filter((loop) => loop.accepted);
  const rows = readFileSync(join(out, "loops.csv"), "utf8").trim().split("\n").length - 1;
  assert.equal(accepted.length, rows);
  assert.ok(accepted.length > 10);
  assert.ok(accepted.every((loop) => loop.right === true && loop.error_m < 0.5 && loop.probability > 0.9));
  assert.ok(accepted.filter((loop) => loop.evidence?.free_space_agreement > 0.5).length > accepted.length / 2);
  assert.ok(view.revisits > 10);
});

test("the tiles are what glTF's makers say they must be", async () => {
  const tiles = readdirSync(join(out, "tiles")).filter((name) => name.endsWith(".glb"));
  assert.ok(tiles.length > 10);
  for (const name of tiles) {
    const { issues } = await validator.validateBytes(new Uint8Array(readFileSync(join(out, "tiles", name))));
    assert.deepEqual(issues.messages, [], name);
  }
});

test("descriptors of detect are made as the run made them", async (context) => {
  const { drive } = slam("of_slam", { length_m: 60 }), out = join(work, "coarse");
  revisit("detect", drive, "--out", out, "--descriptor.rings", "12", "--descriptor.sectors", "40");
  const address = await serve(context, out);
  const { rings, sectors } = await (await fetch(`${address}a/descriptors/5.json`)).json();
  assert.deepEqual([rings, sectors], [12, 40]);
});

test("scans and descriptors come as they were made", async (context) => {
  const address = await serve(context, out);
  const points = new Float32Array(await (await fetch(`${address}a/scans/0.bin`)).arrayBuffer());
  assert.ok(points.length > 4000 && points.length % 4 === 0);
  assert.ok(points.every(Number.isFinite));
  const descriptor = await (await fetch(`${address}a/descriptors/0.json`)).json();
  assert.equal(descriptor.intensity.length, descriptor.rings * descriptor.sectors);
  assert.ok(descriptor.occupied.reduce((sum, each) => sum + each) > 50);
  for (const path of ["a/scans/99999.bin", "a/scans/999999999999999999.bin", "a/descriptors/99999.json", "b/view.json"])
    assert.equal((await fetch(address + path)).status, 404, path);
});

test("what is large is sent as it is: to compress it takes longer than to send it", async (context) => {
  const address = await serve(context, out);
  for (const path of ["viewer.js", "a/view.json", "a/tiles/tileset.json", "a/tiles/0_0_0_0.glb"]) {
    const answer = await fetch(address + path, { headers: { "Accept-Encoding": "gzip, deflate, br" } });
    assert.equal(answer.status, 200, path);
    assert.equal(answer.headers.get("content-encoding"), null, path);
  }
});

test("nothing outside the view is served", async (context) => {
  writeFileSync(join(out, "secret.txt"), "secret");
  symlinkSync(join(out, "secret.txt"), join(out, "tiles", "9_9_9_9.glb"));
  const address = await serve(context, out);
  for (const path of ["/a/tiles/../secret.txt", "/a/tiles/%2e%2e/secret.txt", "/a/tiles/..%2fsecret.txt", "/a/tiles/....//secret.txt",
    "/a/tiles/9_9_9_9.glb", "/a/secret.txt", "/a/run.json", "/../etc/passwd", "//etc/passwd", "/a/tiles/tileset.json%00.glb",
    "/a/scans/../../secret.bin", "/a/tiles/", "/a"]) {
    const answer = await get(address, path);
    assert.match(answer, /^HTTP\/1\.1 40\d/, path);
    assert.doesNotMatch(answer, /secret\b.*$|root:/m, path);
  }
  rmSync(join(out, "tiles", "9_9_9_9.glb"));
});

test("other names, other methods and bodies are refused", async (context) => {
  const address = await serve(context, out);
  assert.match(await raw(address, "GET / HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n"), / 403 /);
  for (const method of ["POST", "PUT", "DELETE", "PATCH"])
    assert.match(await raw(address, `${method} / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\nConnection: close\r\n\r\n`), / 405 /, method);
  const answer = await fetch(address, { headers: { Origin: "http://evil.example" } });
  assert.equal(answer.headers.get("access-control-allow-origin"), null);
  assert.match(answer.headers.get("content-security-policy"), /default-src 'none'/);
  assert.equal(answer.headers.get("x-content-type-options"), "nosniff");
});

test("broken and endless requests do not stop it", async (context) => {
  const address = await serve(context, out);
  const broken = ["\r\n\r\n", "GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", `GET /${"a".repeat(100000)} HTTP/1.1\r\n\r\n`,
    `GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ${"b".repeat(1000000)}\r\n\r\n`, "\0\xff\x01", `GET / HTTP/1.1\r\n${"X: y\r\n".repeat(50000)}\r\n`];
  await Promise.all(broken.map((bytes) => raw(address, bytes, 1000)));
  const slow = Array.from({ length: 8 }, () => raw(address, "GET / HTTP/1.1\r\nHost: 127", 4000));  // never ends its head
  assert.equal((await fetch(address)).status, 200);
  await Promise.all(slow);
});

test("beyond this machine it asks for the token", async (context) => {
  const address = await serve(context, out, "--host", "0.0.0.0");
  const url = new URL(address);
  assert.match(url.searchParams.get("token"), /^[0-9a-f]{32}$/);
  const here = `http://127.0.0.1:${url.port}/`;
  assert.equal((await fetch(here)).status, 403);
  assert.equal((await fetch(`${here}?token=${"0".repeat(32)}`)).status, 403);
  const first = await fetch(`${here}${url.search}`);
  assert.equal(first.status, 200);
  const cookie = first.headers.get("set-cookie");
  assert.match(cookie, /HttpOnly; SameSite=Strict/);
  assert.equal((await fetch(`${here}a/view.json`, { headers: { Cookie: cookie.split(";")[0] } })).status, 200);
});

test("a second page has an address of its own", async (context) => {
  const first = await serve(context, out, "--port", "8137"), second = await serve(context, out, "--port", "8137");
  assert.notEqual(first, second);
});

test("what poses a recording came with is no truth, and a new run forgets the old one's", async (context) => {
  const alone = join(work, "poses_alone");
  cpSync(out, alone, { recursive: true });
  for (const name of ["map.revisit", "reference.txt"]) rmSync(join(alone, name));
  const view = await (await fetch(`${await serve(context, alone)}a/view.json`)).json();
  assert.equal(view.has_truth, false);
  assert.ok(view.loops.every((loop) => loop.right === undefined));
  const again = slam("again", { length_m: 60 }), other = slam("again_other", { length_m: 80 });
  revisit("evaluate", again.out, "--reference", again.drive);
  revisit("slam", other.drive, "--out", again.out, "--overwrite", "--no-map");
  const now = await (await fetch(`${await serve(context, again.out)}a/view.json`)).json();
  assert.equal(now.has_truth, false);
});

test("a run that has just begun is shown, as one without scans", async () => {
  const { address, child } = await start("slam", drive, "--out", join(work, "begun"), "--view");
  for (let scans = 0; scans === 0;) {
    const answer = await fetch(`${address}a/view.json`), said = await answer.text();
    assert.equal(answer.status, 200, said);
    scans = JSON.parse(said).scans.frame.length;
  }
  child.kill("SIGINT");
  await new Promise((resolve) => child.on("exit", resolve));
});

test("many pages that listen leave room for others", async (context) => {
  const address = await serve(context, out), stop = new AbortController();
  const listeners = Array.from({ length: 20 }, () => fetch(`${address}events`, { signal: stop.signal }));
  const answers = await Promise.all(listeners);
  assert.deepEqual(answers.map((answer) => answer.status).sort(), [...Array(16).fill(200), ...Array(4).fill(503)]);
  assert.equal((await fetch(`${address}a/view.json`)).status, 200);
  stop.abort();
});

test("a report of a broken tileset is an error that names it", () => {
  const broken = join(work, "broken");
  cpSync(out, broken, { recursive: true });
  for (const json of ["[]", "{", '{"root":{"content":"x"}}', '{"root":{"content":{"uri":1}}}']) {
    writeFileSync(join(broken, "tiles", "tileset.json"), json);
    assert.throws(() => revisit("view", broken, "--report", join(broken, "r.html")), /error: .*tileset\.json: is no/, json);
  }
});

test("a folder without results is an error that says what to name", () => {
  mkdirSync(join(work, "empty"), { recursive: true });
  assert.throws(() => revisit("view", join(work, "empty")), /holds no results; name a map/);
});

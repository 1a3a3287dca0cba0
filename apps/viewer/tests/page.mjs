// SPDX-License-Identifier: Apache-2.0
// A real browser without windows, and what tests look at in it.
import assert from "node:assert/strict";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

const found = ["/usr/bin/chromium-headless-shell", "/usr/bin/chromium", "/usr/bin/google-chrome"].find(existsSync);
export const browserIsMissing = found ? false : "no Chromium: apt install chromium-headless-shell";

let browser;
export async function open(context, address, options = {}) {
  browser ??= await chromium.launch({ executablePath: found, args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"] });
  const page = await browser.newPage({ viewport: { width: 900, height: 600 }, ...options });
  context.after(() => page.close());
  page.problems = [];
  page.on("pageerror", (error) => page.problems.push(error.message));
  page.on("console", (message) => message.type() === "error" && page.problems.push(message.text()));
  await page.goto(address);
  if (address !== "about:blank") await page.locator("header, [role=alert]").waitFor();
  return page;
}
export const close = () => browser?.close();

/** Points drawn, and whether tiles are still loading. Nothing is drawn while the page loads itself anew, as it does when the
    first tiles of a live map are there. */
async function stageOf(page) {
  try {
    return await page.evaluate(() => {
      const { drawn, loading } = document.getElementById("stage")?.dataset ?? {};
      return [Number(drawn ?? 0), loading !== "false"];
    });
  } catch (problem) {
    if (!/context was destroyed/.test(problem.message)) throw problem;
    return [0, true];
  }
}

/** Until all tiles that the camera wants are drawn. */
export async function settle(page) {
  let last = -1;
  for (let same = 0; same < 3;) {
    await page.waitForTimeout(100);
    const [drawn, loading] = await stageOf(page);
    same = drawn === last && !loading ? same + 1 : 0;
    last = drawn;
  }
  return last;
}

/** Mean colours of blocks of a picture of the page. */
async function blocks(page, columns = 36, rows = 24) {
  const png = (await page.screenshot()).toString("base64");
  return page.evaluate(async ([text, width, height]) => {
    const image = await createImageBitmap(new Blob([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], { type: "image/png" }));
    const canvas = new OffscreenCanvas(width, height), context = canvas.getContext("2d");
    context.imageSmoothingQuality = "high";
    context.drawImage(image, 0, 0, width, height);
    return [...context.getImageData(0, 0, width, height).data].filter((_, i) => i % 4 !== 3);
  }, [png, columns, rows]);
}

/** Until the page looks like the reference of that name, whose blocks' colours it then repeats within 12 of 255 (root mean square);
    a page that has not within ten seconds fails. UPDATE=1 writes the reference. */
export async function looksLike(page, name) {
  const file = join(fileURLToPath(new URL(".", import.meta.url)), "references", `${name}.json`), until = Date.now() + 10_000;
  if (process.env.UPDATE) writeFileSync(file, JSON.stringify(await blocks(page)) + "\n");
  const reference = JSON.parse(readFileSync(file, "utf8"));
  for (let rms = Infinity; rms >= 12;) {
    const now = await blocks(page);
    rms = Math.sqrt(now.reduce((sum, value, i) => sum + (value - reference[i]) ** 2, 0) / now.length);
    assert.ok(rms < 12 || Date.now() < until, `${name}: differs from its reference by ${rms.toFixed(1)} of 255`);
  }
}

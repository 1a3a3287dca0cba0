// SPDX-License-Identifier: Apache-2.0
// Runs the program: `revisit COMMAND ...`, and `revisit view` as a server that ends with the test.
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

export const program = process.env.REVISIT_PROGRAM;
export const work = mkdtempSync(join(tmpdir(), "revisit_viewer_"));

export const revisit = (...args) => execFileSync(program, args, { stdio: ["ignore", "pipe", "pipe"] }).toString();

/** A drive around a block, twice; the results of slam, in a folder of that name. */
export function slam(name, options = {}, more = []) {
  const drive = { world: '"town"', sensor: '"vlp16"', length_m: 430, difficulty: 0.5, seed: 5, ...options };
  const file = join(work, `${name}.toml`);
  writeFileSync(file, "[simulation]\n" + Object.entries(drive).map(([key, value]) => `${key} = ${value}\n`).join(""));
  const out = join(work, name);
  revisit("slam", file, "--out", out, ...more);
  return { drive: file, out };
}

export async function serve(context, ...args) {
  const child = spawn(program, ["view", ...args, "--port", "0"], { stdio: ["ignore", "pipe", "pipe"] });
  context.after(() => child.kill("SIGINT"));
  let said = "";
  child.stderr.on("data", (text) => (said += text));
  return new Promise((resolve, reject) => {
    child.stdout.on("data", (text) => {
      const address = String(text).match(/http:\/\/\S+/);
      if (address) resolve(address[0]);
    });
    child.on("exit", (code) => reject(new Error(`revisit view ended with ${code}: ${said}`)));
  });
}

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

const children = new Set();
/** Ends what a failed test left running: node would wait for it. */
export const stopAll = () => children.forEach((child) => child.kill("SIGKILL"));

/** A command that serves a page, until the program has named its address. */
export function start(...args) {
  const child = spawn(program, args, { stdio: ["ignore", "pipe", "pipe"] });
  children.add(child);
  child.on("exit", () => children.delete(child));
  let said = "";
  return new Promise((resolve, reject) => {
    const listen = (text) => {
      const address = (said += text).match(/http:\/\/\S+/);
      if (address) resolve({ address: address[0], child });
    };
    child.stdout.on("data", listen);
    child.stderr.on("data", listen);
    child.on("exit", (code) => reject(new Error(`revisit ${args[0]} ended with ${code}: ${said}`)));
  });
}

export async function serve(context, ...args) {
  const { address, child } = await start("view", ...args, ...(args.includes("--port") ? [] : ["--port", "0"]));
  context.after(() => child.kill("SIGINT"));
  return address;
}

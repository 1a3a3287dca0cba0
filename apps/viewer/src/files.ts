// SPDX-License-Identifier: Apache-2.0
// Where the page's files come from: the server, or, in a report, the page itself.

const embedded: Record<string, string> | null = (() => {
  const element = document.getElementById("files");
  return element ? JSON.parse(element.textContent ?? "{}") : null;
})();

export const isReport = embedded !== null;

/** The file as a response; of a binary one in a report, base64 stands for its bytes. */
export async function read(name: string): Promise<Response> {
  if (!embedded) return fetch(name);
  const text = embedded[name];
  if (text === undefined) return new Response("not in this report, which has the scans of its weakest loops; revisit view shows all", { status: 404 });
  if (!/\.(glb|bin)$/.test(name)) return new Response(text);
  return new Response(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
}

async function checked(name: string): Promise<Response> {
  const response = await read(name);
  if (!response.ok) throw new Error(`${name}: ${(await response.text()).trim()}`);
  return response;
}

export const readJson = async (name: string): Promise<any> => (await checked(name)).json();

export const readFloats = async (name: string): Promise<Float32Array> => {
  const bytes = await (await checked(name)).arrayBuffer();
  return new Float32Array(bytes, 0, Math.floor(bytes.byteLength / 16) * 4);
};

// SPDX-License-Identifier: Apache-2.0
// What the format's own library finds in .mcap files: a line a message, with topic, type, time and a checksum.
import { open } from "node:fs/promises";
import zlib from "node:zlib";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";

const table = new Uint32Array(256).map((_, i) => {
  let value = i;
  for (let bit = 0; bit < 8; ++bit) value = (value >>> 1) ^ (value & 1 ? 0xedb88320 : 0);
  return value;
});
function checksum(bytes) {
  if (zlib.crc32 !== undefined) return zlib.crc32(bytes);
  let value = 0xffffffff;
  for (const byte of bytes) value = (value >>> 8) ^ table[(value ^ byte) & 255];
  return (value ^ 0xffffffff) >>> 0;
}

const file = process.argv[2];
const handle = await open(file, "r");
const decompressHandlers = await loadDecompressHandlers();
const schemas = new Map();
const channels = new Map();
function print(message) {
  const channel = channels.get(message.channelId);
  const type = (schemas.get(channel.schemaId)?.name ?? "").replace("/msg/", "/");
  console.log(`${channel.topic} ${type} ${message.logTime} ${checksum(message.data).toString(16).padStart(8, "0")}`);
}
try {
  const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle), decompressHandlers });
  reader.schemasById.forEach((schema, id) => schemas.set(id, schema));
  reader.channelsById.forEach((channel, id) => channels.set(id, channel));
  for await (const message of reader.readMessages()) print(message);
} catch {
  // Files without an index are read from the front.
  const reader = new McapStreamReader({ decompressHandlers, includeChunks: false });
  reader.append(await handle.readFile());
  for (let record; (record = reader.nextRecord()) !== undefined; ) {
    if (record.type === "Schema") schemas.set(record.id, record);
    if (record.type === "Channel") channels.set(record.id, record);
    if (record.type === "Message") print(record);
  }
} finally {
  await handle.close();  // one that is left to the garbage collector is warned of
}

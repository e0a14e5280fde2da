// Reads a recording as web viewers do (@mcap/core, @mcap/support, protobufjs): node read.mjs FOLDER FILE
// FOLDER holds node_modules: npm install @mcap/core @mcap/nodejs @mcap/support
import { open } from "node:fs/promises";
import { createRequire } from "node:module";

const [folder, file] = process.argv.slice(2);
const load = createRequire(`${folder}/package.json`);
const { McapIndexedReader } = load("@mcap/core");
const { FileHandleReadable } = load("@mcap/nodejs");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = load("@mcap/support");

const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(await open(file, "r")),
  decompressHandlers: await loadDecompressHandlers(),
});
const types = {};
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  types[channel.id] = [channel.topic, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name)];
}
const counts = {};
let sum = 0.0;
for await (const message of reader.readMessages()) {
  const [topic, type] = types[message.channelId];
  counts[topic] = (counts[topic] ?? 0) + 1;
  if (topic === "/tick") sum += type.decode(message.data).q_slew;
}
console.log(JSON.stringify({ counts, sum }));

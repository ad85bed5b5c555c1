// Decode every message of a log. Print the number of messages and the last message of each topic.
import { readFileSync } from "node:fs";
import { McapIndexedReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";

const bytes = readFileSync(process.argv[2]);
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });

const types = new Map();
for (const { id, name, encoding, data } of reader.schemasById.values()) {
  if (encoding !== "protobuf") throw new Error(`schema ${name} has the encoding ${encoding}; protobuf is expected`);
  types.set(id, protobufFromBinaryDescriptor(data).lookupType(name));
}

const topics = {};
let previous = 0n;
for await (const { channelId, logTime, data } of reader.readMessages({ validateCrcs: true })) {
  if (logTime < previous) throw new Error(`messages out of order at ${logTime} ns`);
  previous = logTime;
  const { topic, schemaId } = reader.channelsById.get(channelId);
  const type = types.get(schemaId);
  topics[topic] = { count: (topics[topic]?.count ?? 0) + 1, last: type.toObject(type.decode(data), { enums: String }) };
}
console.log(JSON.stringify(topics));

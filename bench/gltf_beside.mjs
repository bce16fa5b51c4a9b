// SPDX-License-Identifier: Apache-2.0
// `tgconvert check` and Khronos' validator on the same GLB: what gltf_rules.mjs and gltf_mutations.mjs share.
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import { createRequire } from 'node:module';

// The JSON's text and the content of the BIN chunk.
export function partsOf(file) {
  const bytes = fs.readFileSync(file);
  const jsonBytes = bytes.readUInt32LE(12);
  return { text: bytes.subarray(20, 20 + jsonBytes).toString(), bin: Buffer.from(bytes.subarray(20 + jsonBytes + 8)) };
}

export function glb(json, data) {
  let head = Buffer.from(JSON.stringify(json));
  head = Buffer.concat([head, Buffer.alloc((4 - (head.length % 4)) % 4, 0x20)]);
  const out = Buffer.alloc(20 + head.length + 8);
  out.write('glTF');
  out.writeUInt32LE(2, 4);
  out.writeUInt32LE(out.length + data.length, 8);
  out.writeUInt32LE(head.length, 12);
  out.write('JSON', 16);
  head.copy(out, 20);
  out.writeUInt32LE(data.length, 20 + head.length);
  out.write('BIN\0', 24 + head.length);
  return Buffer.concat([out, data]);
}

// What the validator cannot know: it has heard of neither extension.
const foreign = (message) =>
  /^\/extensions(Used|Required)/.test(message.pointer) === false &&
  ['MESH_PRIMITIVE_INVALID_ATTRIBUTE', 'UNSUPPORTED_EXTENSION'].includes(message.code) &&
  /:/.test(message.pointer.split('/').pop());

// Errors of both: codes with pointers, and {pointer, message}. The validator is that of the folder one is in.
export async function beside(program, file) {
  const validator = createRequire(process.cwd() + '/')('gltf-validator');
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), { maxIssues: 0 }).catch(
    (error) => ({ issues: { messages: [{ severity: 0, code: String(error), pointer: '' }] } }));
  const theirs = report.issues.messages.filter((m) => m.severity === 0 && !foreign(m));
  let output;
  try {
    output = execFileSync(program, ['check', file, '--json'], { stdio: ['ignore', 'pipe', 'ignore'] });
  } catch (error) {
    output = error.stdout;
  }
  return { theirs, ours: JSON.parse(output).errors };
}

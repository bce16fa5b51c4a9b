// SPDX-License-Identifier: Apache-2.0
// Khronos' validator on the files named, less what it cannot know yet (docs/lab/browsers.md): prints a line of JSON
// a file, {file, left: ["severity CODE pointer message"], dropped: {code: count}}.
const fs = require('fs');
const validator = require('gltf-validator');

const OURS = /^(KHR_gaussian_splatting|TG_gaussian_splatting_texture):[A-Z0-9_]+$/;

// True for a message that says no more than that the validator of 2024 does not know the two extensions.
function unknowing({code, pointer}) {
  const last = (pointer || '').split('/').pop();
  return code === 'UNSUPPORTED_EXTENSION' || code === 'IMAGE_NPOT_DIMENSIONS' ||
    (code === 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' && OURS.test(last)) ||
    (code === 'UNUSED_OBJECT' && /^\/textures\//.test(pointer));
}

(async () => {
  for (const file of process.argv.slice(2)) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {maxIssues: 0});
    const dropped = {}, left = [];
    for (const message of report.issues.messages) {
      if (unknowing(message)) {
        dropped[message.code] = (dropped[message.code] || 0) + 1;
      } else {
        left.push(`${message.severity} ${message.code} ${message.pointer} ${message.message}`);
      }
    }
    console.log(JSON.stringify({file, left, dropped}));
  }
})();

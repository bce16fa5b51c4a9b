// SPDX-License-Identifier: Apache-2.0
// Words of files that stand for something.

// What `table` has under a name that a file gives, or undefined: "constructor", which every object has, is no name of
// its own.
export function valueNamed(table, name) {
  return typeof name === 'string' && Object.hasOwn(table, name) ? table[name] : undefined;
}

// SPDX-License-Identifier: Apache-2.0
// Words of files and addresses that stand for something.

// What `table` has under a name that a file gives, or undefined: "constructor", which every object has, is no name of
// its own.
export function valueNamed(table, name) {
  return typeof name === 'string' && Object.hasOwn(table, name) ? table[name] : undefined;
}

// The whole number, from 0, that an address or a caller gives, or NaN: "0x2", "1e1" and "" are none.
export function wholeNumber(given) {
  return /^\d+$/.test(given) ? Number(given) : NaN;
}

// SPDX-License-Identifier: Apache-2.0
// Sorts Gaussians by camera z, farthest first, in a worker: exactly docs/math.md 1.2 (float32 z, the lower index in
// front on ties), by counting the two 16-bit halves of the float's bits, which order positive floats. Gaussians stand
// in places, some of which are shown; what the others hold may change meanwhile.

// What the worker runs. It travels as text: it uses nothing of this file.
function sorting() {
  const kBuckets = 65536;
  const kNear = 0.2;  // shaders/shared/limits.h
  const low = new Uint32Array(kBuckets), high = new Uint32Array(kBuckets);
  let positions, depths, bits, indices, keys, byLow;
  let runs = [];  // first place and count, of those that are shown

  function open(places) {
    positions = new Float32Array(3 * places);
    depths = new Float32Array(places);
    bits = new Uint32Array(depths.buffer);
    indices = new Uint32Array(places);
    keys = new Uint32Array(places);
    byLow = new Uint32Array(places);
  }

  // `row`: the third row of camera_from_world and the translation's z. Fills `order` (room for all), returns how many
  // Gaussians lie in front of the near plane.
  function sort(row, order) {
    const [rx, ry, rz, t] = row;
    low.fill(0);
    high.fill(0);
    let visible = 0;
    for (let run = 0; run < runs.length; run += 2) {
      for (let i = runs[run], end = i + runs[run + 1]; i < end; ++i) {
        const z = rx * positions[3 * i] + ry * positions[3 * i + 1] + rz * positions[3 * i + 2] + t;
        if (!(z > kNear)) continue;
        depths[visible] = z;
        const key = bits[visible];
        ++low[key & 0xFFFF];
        ++high[key >>> 16];
        indices[visible++] = i;
      }
    }
    for (let bucket = 0, a = 0, b = 0; bucket < kBuckets; ++bucket) {
      const inLow = low[bucket], inHigh = high[bucket];
      low[bucket] = a;
      high[bucket] = b;
      a += inLow;
      b += inHigh;
    }
    for (let i = 0; i < visible; ++i) {
      const to = low[bits[i] & 0xFFFF]++;
      keys[to] = bits[i];
      byLow[to] = indices[i];
    }
    for (let i = 0; i < visible; ++i) order[visible - 1 - high[keys[i] >>> 16]++] = byLow[i];
    return visible;
  }

  onmessage = ({data}) => {
    if (data.places) open(data.places);
    if (data.positions) positions.set(data.positions, 3 * data.first);
    if (data.runs) runs = data.runs;
    if (!data.row) return;
    const order = data.order || new Uint32Array(indices.length);
    postMessage({order, visible: sort(data.row, order), showing: data.showing}, [order.buffer]);
  };
}

export class Sorter {
  // `places`: how many Gaussians there may be. onChange(): there is an order to take().
  constructor(places, {onChange, onError}) {
    const text = new Blob([`(${sorting})()`], {type: 'text/javascript'});
    this.address = URL.createObjectURL(text);
    this.worker = new Worker(this.address);
    this.worker.onmessage = ({data}) => this.sorted(data);
    this.worker.onerror = (event) => {  // a worker that may not begin gives no reason
      const why = event.message || 'the page must allow worker-src blob:';
      this.failed = new Error(`The sorting worker failed: ${why}`);
      this.busy = false;
      onError(this.failed);
    };
    this.onChange = onChange;
    this.busy = false;
    this.failed = null;   // why no order comes any more
    this.asked = null;    // what the last order was asked for
    this.wanted = null;   // what came while it was made
    this.ready = null;    // {order, visible, showing} that nobody has taken
    this.spare = null;    // an order to fill again
    this.showing = 0;     // counts what show() was told
    this.worker.postMessage({places});
  }

  // Positions of the places from `first` on, three numbers each, which are the sorter's from now on. None of these
  // places is shown.
  put(first, positions) { this.worker.postMessage({first, positions}, [positions.buffer]); }

  // Shows the places of `runs` alone, first place and count in turns, from the next order on that is wanted.
  show(runs) {
    this.worker.postMessage({runs});
    this.asked = null;
    return ++this.showing;
  }

  // `row`: as in the worker. The order that comes is that of the last row asked for, maybe after those of others.
  want(row) {
    if (this.failed) return;
    if (this.busy) {
      this.wanted = row;
      return;
    }
    if (this.asked && row.every((x, k) => x === this.asked[k])) return;
    this.asked = row;
    this.busy = true;
    const {showing, spare: order} = this;
    this.worker.postMessage({row, order, showing}, order ? [order.buffer] : []);
    this.spare = null;
  }

  sorted(answer) {
    this.busy = false;
    if (this.ready) this.spare = this.ready.order;
    this.ready = answer;
    const row = this.wanted;
    this.wanted = null;
    if (row) this.want(row);
    this.onChange();
  }

  // Calls body(order, visible, showing) if there is a newer order than the last one taken: indices of places, which are
  // the body's until it returns, and what show() returned for those that are among them.
  take(body) {
    if (!this.ready) return;
    const {order, visible, showing} = this.ready;
    this.ready = null;
    body(order, visible, showing);
    this.spare = order;
  }

  dispose() {
    this.worker.onmessage = null;
    this.worker.terminate();
    URL.revokeObjectURL(this.address);
  }
}

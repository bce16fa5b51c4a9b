// SPDX-License-Identifier: Apache-2.0
// Curves over the iterations of a run, as SVG.

const SVG = 'http://www.w3.org/2000/svg';
const CHART_HEIGHT = 130, MARGIN = {left: 44, right: 10, top: 6, bottom: 18};  // [px]; left: at least
const LABEL_GAP = 6;     // [px] beside the labels of the vertical axis
const LEAST_SURE = 5;    // steps of at most half of what is divided: a step is at most 2.5 times what was asked for
const LABEL_DIGITS = 9;  // at most

function svg(name, attributes, ...children) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

// About `count` round numbers from low to high, two at least: one says nothing of an axis' scale.
function ticks(low, high, count) {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw);
  const list = [];
  for (let i = Math.ceil(low / step); i * step <= high * (1 + 1e-9); ++i) list.push(i * step);
  return list.length > 1 || count >= LEAST_SURE ? list : ticks(low, high, count + 1);
}

function shortNumber(value, digits = 4) {
  const size = Math.abs(value);
  const [unit, sign] = size >= 1e6 ? [1e6, ' M'] : size >= 1e4 ? [1e3, ' k'] : [1, ''];
  return `${+(value / unit).toPrecision(digits)}${sign}`;
}

// With as many digits as tell them apart.
function labelsOf(values, digits = 4) {
  const labels = values.map((value) => shortNumber(value, digits));
  return new Set(labels).size === values.length || digits >= LABEL_DIGITS ? labels : labelsOf(values, digits + 1);
}

class Chart {
  // `box`: an element that the chart fills.
  constructor(box) {
    this.box = box;
    this.series = [];
    this.marks = [];
    box.addEventListener('pointermove', (event) => this.point(event));
    box.addEventListener('pointerleave', () => this.draw());
  }

  // series: [{color, dots, values: [[x, y], ...]}] in order of x; marks: the x at which stages begin.
  set(series, marks) {
    this.series = series;
    this.marks = marks;
    this.draw();
  }

  draw() {
    const width = Math.max(this.box.clientWidth, 120);
    const all = this.series.flatMap(({values}) => values);
    this.root = svg('svg', {viewBox: `0 0 ${width} ${CHART_HEIGHT}`});
    this.box.replaceChildren(this.root);
    if (all.length === 0) return;
    // What is worst at the very beginning says nothing about the rest: the axis leaves it out.
    const spread = all.map(([, y]) => y).sort((a, b) => a - b);
    const at = (share) => spread[Math.min(Math.floor(share * spread.length), spread.length - 1)];
    let low = at(0.01), high = at(0.99);
    for (const {dots, values} of this.series) {
      if (!dots) continue;
      for (const [, y] of values) [low, high] = [Math.min(low, y), Math.max(high, y)];
    }
    const room = 0.06 * (high - low) || Math.max(Math.abs(high), 1e-6) * 0.1;
    [low, high] = [low - room, high + room];
    const last = Math.max(...all.map(([x]) => x), 1);
    const label = (attributes, text) => this.root.appendChild(svg('text', {...attributes, fill: '#a4a6ad'}, text));
    const heights = ticks(low, high, 3);
    const levels = labelsOf(heights).map((text) => label({'text-anchor': 'end'}, text));
    const left = Math.max(MARGIN.left, ...levels.map((text) => text.getComputedTextLength() + 2 * LABEL_GAP));
    const inside = {width: width - left - MARGIN.right, height: CHART_HEIGHT - MARGIN.top - MARGIN.bottom};
    this.x = (value) => left + value / last * inside.width;
    this.y = (value) => MARGIN.top + (high - Math.min(Math.max(value, low), high)) / (high - low) * inside.height;
    const bottom = MARGIN.top + inside.height, right = left + inside.width;
    for (const [i, value] of heights.entries()) {
      this.root.append(svg('line', {x1: left, x2: right, y1: this.y(value), y2: this.y(value), stroke: '#2b2d34'}));
      levels[i].setAttribute('x', left - LABEL_GAP);
      levels[i].setAttribute('y', this.y(value) + 3);
    }
    const times = ticks(0, last, Math.max(inside.width / 80, 2)), words = labelsOf(times);
    words[0] = `iteration ${words[0]}`;
    for (const [i, value] of times.entries()) {
      const text = label({y: CHART_HEIGHT - 4, 'text-anchor': i === 0 ? 'start' : 'middle'}, words[i]);
      text.setAttribute('x', Math.min(this.x(value), width - 1 - (i === 0 ? 0 : text.getComputedTextLength() / 2)));
    }
    for (const value of this.marks) {
      this.root.append(svg('line', {x1: this.x(value), x2: this.x(value), y1: MARGIN.top, y2: bottom, stroke: '#5a5d66',
                                    'stroke-dasharray': '3 3'}));
    }
    for (const {color, dots, values} of this.series) {
      const points = values.map(([x, y]) => [this.x(x).toFixed(1), this.y(y).toFixed(1)]);
      if (dots) {
        for (const [x, y] of points) this.root.append(svg('circle', {cx: x, cy: y, r: 3.5, fill: color}));
      } else if (points.length > 0) {
        this.root.append(svg('path', {d: `M${points.map((p) => p.join(' ')).join('L')}`, fill: 'none', stroke: color,
                                      'stroke-width': 1.5, 'stroke-linejoin': 'round'}));
      }
    }
  }

  // The values nearest to the pointer.
  point(event) {
    this.draw();
    const frame = this.box.getBoundingClientRect();
    const distance = ([x]) => Math.abs(this.x(x) - (event.clientX - frame.left));
    const nearest = (values) => values.reduce((best, value) => distance(value) < distance(best) ? value : best);
    const found = this.series.filter(({values}) => values.length > 0)
      .map(({color, values}) => ({color, value: nearest(values)}));
    if (found.length === 0) return;
    const x = this.x(found[0].value[0]);
    this.root.append(svg('line', {x1: x, x2: x, y1: MARGIN.top, y2: CHART_HEIGHT - MARGIN.bottom, stroke: '#a4a6ad'}));
    const leftward = x > 0.6 * frame.width;
    const words = [{color: '#e8e8ea', text: `iteration ${found[0].value[0].toLocaleString('en')}`},
                   ...found.map(({color, value}) => ({color, text: shortNumber(value[1])}))];
    words.forEach(({color, text}, line) => this.root.append(
      svg('text', {x: x + (leftward ? -6 : 6), y: MARGIN.top + 10 + 12 * line, fill: color,
                   'text-anchor': leftward ? 'end' : 'start', stroke: '#17181d', 'stroke-width': 3,
                   'paint-order': 'stroke'}, text)));
    for (const {color, value} of found) {
      this.root.append(svg('circle', {cx: this.x(value[0]), cy: this.y(value[1]), r: 3, fill: color}));
    }
  }
}

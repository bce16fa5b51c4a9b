// SPDX-License-Identifier: Apache-2.0
// What the program says, asked time and again: the run's curves and numbers, and its newest model.

const PAUSE = 400;            // [ms] between an answer and the next question
const LOST_AFTER = 5000;      // [ms] without an answer
const STALLED_AFTER = 30000;  // [ms] between two parts of a picture or a model
const COLORS = {train: '#5b8af0', test: '#f0a35b', loss: '#6fc2a0', gaussians: '#b79be0'};

const token = new URLSearchParams(location.search).get('token');

// The answer's bytes; given up once nothing has come for so long. [ms]
async function ask(path, patience = STALLED_AFTER) {
  const headers = token ? {Authorization: `Bearer ${token}`} : {};
  const silence = new AbortController();
  let timer = 0;
  const wait = () => {
    clearTimeout(timer);
    timer = setTimeout(() => silence.abort(new Error(`no bytes for ${duration(patience / 1000)}`)), patience);
  };
  wait();
  try {
    const answer = await fetch(path, {headers, signal: silence.signal});
    const parts = [];
    const reader = answer.body.getReader();
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      parts.push(part.value);
      wait();
    }
    const body = new Blob(parts, {type: answer.headers.get('Content-Type') || ''});
    if (!answer.ok) throw new Error((await body.text()).trim() || `${path}: ${answer.status}`);
    return body;
  } finally {
    clearTimeout(timer);
  }
}

function duration(seconds) {
  const whole = Math.round(seconds);
  const two = (number) => String(number).padStart(2, '0');
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
  return `${Math.floor(whole / 3600)} h ${two(Math.floor(whole % 3600 / 60))} min`;
}

const decibels = (value) => value === null ? null : `${value.toFixed(2)} dB`;

class RunPanel {
  constructor() {
    this.rows = [];
    this.generation = -1;
    this.charts = Object.fromEntries(['psnr', 'loss', 'gaussians'].map((id) => [id, new Chart(element(id))]));
    this.heldOut = '';
    this.paused = false;
    new ResizeObserver(() => Object.values(this.charts).forEach((chart) => chart.draw())).observe(element('run'));
  }

  get question() { return `state.json?generation=${this.generation}&from=${this.rows.length}`; }

  // The next question is for all that there is.
  forget() { this.generation = -1; }

  update({run, metrics, paused}) {
    this.paused = this.paused || paused;  // of a program before, too: the run's seconds hold its pauses
    element('run').hidden = !run;
    const news = metrics.generation !== this.generation || metrics.rows.length > 0;
    if (metrics.generation !== this.generation || metrics.from !== this.rows.length) this.rows = [];
    this.generation = metrics.generation;
    this.rows.push(...metrics.rows);
    if (!run) return;
    this.numbers(run);
    if (news) this.curves();
  }

  numbers(run) {
    element('run-name').textContent = run.name;
    const phase = element('phase');
    phase.textContent = run.phase;
    phase.className = run.phase;
    const share = run.iterations > 0 ? run.iteration / run.iterations : 1;
    element('bar').style.width = `${100 * share}%`;
    element('progress').setAttribute('aria-valuenow', String(Math.round(100 * share)));
    const ended = run.phase === 'finished' || run.phase === 'interrupted';
    const known = run.seconds_left !== null && !ended;
    const told = known && !this.paused;
    const done = told ? Math.floor(100 * run.seconds / Math.max(run.seconds + run.seconds_left, 1)) : 0;
    element('stage-line').textContent = `stage ${run.stage}: ${run.iteration.toLocaleString('en')} of ` +
      `${run.iterations.toLocaleString('en')} iterations${told ? `, about ${done}\u00A0% of the run's time` : ''}`;
    const facts = [['training', decibels(run.train_psnr)], ['held out', decibels(run.test_psnr)],
                   ['loss', run.loss === null ? null : run.loss.toFixed(4)],
                   ['Gaussians', run.gaussians.toLocaleString('en')],
                   ['speed', run.per_second === null ? null : `${run.per_second.toFixed(1)} it/s`],
                   ended ? ['took', duration(run.seconds)]
                         : ['left', run.seconds_left === null ? null : duration(run.seconds_left)]];
    element('numbers').replaceChildren(...facts.map(([name, value]) => {
      const box = document.createElement('div');
      box.append(Object.assign(document.createElement('dt'), {textContent: name}),
                 Object.assign(document.createElement('dd'), {textContent: value === null ? '-' : value}));
      return box;
    }));
    const left = known ? `, ${duration(run.seconds_left)} left` : '';
    document.title = `${ended ? run.phase : `${run.stage} ${Math.floor(100 * share)} %`}${left} - ${run.name}`;
  }

  curves() {
    let before = 0, last = 0, stage = null;
    const marks = [], at = [];
    for (const [name, iteration] of this.rows) {
      if (stage !== null && name !== stage) marks.push(before = last);
      stage = name;
      last = Math.max(last, before + iteration);
      at.push(before + iteration);
    }
    const values = (column) => this.rows.map((row, i) => [at[i], row[column]]).filter(([, y]) => y !== null);
    this.charts.psnr.set([{color: COLORS.train, values: values(3)}, {color: COLORS.test, dots: true, values: values(4)}],
                         marks);
    this.charts.loss.set([{color: COLORS.loss, values: values(2)}], marks);
    this.charts.gaussians.set([{color: COLORS.gaussians, values: values(5)}], marks);
  }

  // `stamp` names them among those of all programs; '': there are none.
  async pictures(stamp, name) {
    if (stamp === this.heldOut || stamp === '') return;
    const load = async (id, path) => {
      const image = element(id);
      const url = URL.createObjectURL(await ask(path));
      if (image.src) URL.revokeObjectURL(image.src);
      image.src = url;
    };
    await Promise.all([load('photograph', 'photograph.png'), load('rendering', 'picture.png')]);
    this.heldOut = stamp;
    element('held-out-name').textContent = name;
    element('held-out').hidden = false;
  }
}

// The model that is looked at.
class ModelView {
  constructor() {
    this.viewer = openViewer();
    this.panel = new Panel(this.viewer, '');
    this.panel.open(false);
    this.shown = '';
    this.failed = {stamp: '', why: null};  // a model that cannot be shown
    const label = document.createElement('label');
    this.follow = Object.assign(document.createElement('input'), {type: 'checkbox', checked: true, id: 'follow'});
    label.append(this.follow, ' new models as they come');
    element('more').append(label);
    listenToHands(this.viewer);
    addEventListener('resize', () => this.viewer.changed());
    new ResizeObserver(() => this.viewer.changed()).observe(element('stage'));
    window.tgViewer = this.viewer;
  }

  // `stamp` as of RunPanel's pictures. Whether the model is one that was not shown before.
  async update(stamp, title) {
    const wanted = !this.viewer.model || this.follow.checked;
    if (stamp === this.shown || stamp === '' || !wanted) return false;
    if (stamp === this.failed.stamp) throw this.failed.why;
    const bytes = new Uint8Array(await (await ask('model.glb')).arrayBuffer());
    try {
      const read = await readModel(bytes);
      if (!this.viewer.model) {
        await this.viewer.open(read);
        this.viewer.applyWhatCan(Object.fromEntries(new URLSearchParams(location.hash.slice(1))));
      } else {
        await this.viewer.replace(read);
      }
    } catch (why) {
      this.failed = {stamp, why};
      throw why;
    }
    this.shown = stamp;
    this.panel.name = title;
    this.panel.fill();
    element('waiting').hidden = true;
    return true;
  }
}

// Another program's page, or the page of another subject, whose views are not those that the address may name. Never
// returns.
function loadAnew(sameSubject) {
  if (!sameSubject) history.replaceState(null, '', location.pathname + location.search);
  location.reload();
  return new Promise(() => {});
}

// window.__shown counts the models drawn, for tests.
async function startLive() {
  for (const name of ['dragover', 'drop']) addEventListener(name, (event) => event.preventDefault());  // leaves no page
  const run = new RunPanel();
  let model = null;
  try {
    model = new ModelView();
  } catch (error) {
    showMessage(error.message);
    element('waiting').hidden = true;
  }
  let answered = performance.now(), lastAnswer = new Date(), said = {words: '', state: ''};
  // Once for each `state`: what was read out or closed is not said again.
  const say = (words, state = words) => {
    if (state === said.state) return;
    if (words !== '' || element('message').firstElementChild.textContent === said.words) showMessage(words);
    said = {words, state};
  };
  // Meanwhile the state is asked for: what is slow, or does not come, holds up no word.
  const busy = {}, trouble = {};  // by kind: whether one is on its way, and what went wrong with the last one
  const beside = async (kind, work) => {
    if (busy[kind]) return;
    busy[kind] = true;
    trouble[kind] = null;
    await work().catch((error) => { trouble[kind] = error; });
    busy[kind] = false;
  };
  const showModel = async (name, stamp) => {
    if (await model.update(stamp, name)) window.__shown = (window.__shown || 0) + 1;
  };
  let program = null;  // what the one that answers says of itself
  const once = async () => {
    const state = JSON.parse(await (await ask(run.question, LOST_AFTER)).text());
    answered = performance.now();
    lastAnswer = new Date();
    const {start, title, page, subject} = state, before = program;
    program = {start, page, subject};
    if (before !== null && start !== before.start) {  // what has begun anew numbers all anew
      if (page !== before.page || subject !== before.subject) await loadAnew(subject === before.subject);
      run.forget();
      return;
    }
    if (!state.run) document.title = title;
    run.update(state);
    const stamp = (number) => (number === 0 ? '' : `${start}.${number}`);  // programs count from 1 on
    const {held_out: pair} = state;
    beside('pictures', () => run.pictures(stamp(pair.number), pair.name));
    if (model) beside('model', () => showModel(state.run ? state.run.name : title, stamp(state.model)));
  };
  for (;;) {
    if (!document.hidden) {
      let failed = null;
      await once().catch((error) => failed = error);
      failed = failed || trouble.model || trouble.pictures;
      const ended = ['finished', 'interrupted'].includes(element('phase').className);
      if (failed && !ended && performance.now() - answered > LOST_AFTER) {
        element('phase').textContent = 'no answer';
        element('phase').className = 'lost';
        say(`No answer since ${lastAnswer.toLocaleTimeString()}: ${failed.message}`, 'lost');
      } else if (failed && failed.message.includes('token')) {
        say(failed.message);
      } else if (trouble.model && trouble.model === model.failed.why) {
        say(trouble.model.message);
      } else if (!failed) {
        say('');
      }
    }
    await new Promise((resolve) => setTimeout(resolve, PAUSE));
  }
}

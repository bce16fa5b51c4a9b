// SPDX-License-Identifier: Apache-2.0
// What stands around the picture: bar, panel, keys, messages.

const OUTSIDE_TITLES = {base: 'beyond its texture a splat shows its base colour', clip: 'a splat ends with its texture',
                        edge: 'beyond its texture a splat has the texels of the border'};
const SMALL = [600, 400];  // [px] up to which the panel waits to be asked for
const OWN_KEYS = ['SELECT', 'INPUT', 'TEXTAREA'];
const DONE_STAYS = 2700, DONE_FADES = 300;  // [ms] of a word that something is done
const HAS_ADDRESS = !/^(about|blob|data):/.test(location.href);  // one that leads somewhere from elsewhere
const FREE_VIEW = '-1';  // of the list of views, while it is none of them
// Words in names of a query's parameters that open a door: servers' tokens, storages' signed addresses.
const CREDENTIALS = new RegExp('token|secret|signature|passw|credential|hmac|jwt|api.?key|access.?key|auth(?!or)|' +
                               'authoriz|sess(ion)?_?id|hdn(ts|ea)', 'i');
const SHORT_CREDENTIALS = /(^|[^a-z])(key|sig|sas|pwd|pass|session|sid)([^a-z]|$)/i;

const element = (id) => document.getElementById(id);

// An address as it may be given away, and the names of what was left out of it: {address, kept: names}.
function withoutCredentials(address) {
  const url = new URL(address), kept = [];
  if (url.username || url.password) kept.push('password');
  url.username = url.password = '';
  const parts = url.search.slice(1).split('&').filter((part) => {
    const [[name] = ['']] = new URLSearchParams(part);
    const secret = CREDENTIALS.test(name) || SHORT_CREDENTIALS.test(name);
    if (secret) kept.push(name);
    return !secret;
  });
  url.search = parts.join('&');
  return {address: url.href, kept};
}

let fading = null;  // the animation at whose end a word goes by itself

// kind: '' of what went wrong, 'note', 'link' of one to copy, or 'done' of what goes by itself.
function showMessage(text, kind = '') {
  const box = element('message');
  if (fading) fading.cancel();
  box.firstElementChild.textContent = text;
  box.lastElementChild.onclick = () => { box.hidden = true; };
  box.className = kind;
  box.hidden = text === '';
  fading = kind === 'done' ? box.animate({opacity: [1, 0]}, {delay: DONE_STAYS, duration: DONE_FADES}) : null;
  if (fading) fading.onfinish = () => { box.hidden = true; };
}

// Throws without WebGL 2.
function openViewer() {
  const viewer = new Viewer(element('picture'));
  viewer.onError = (error) => showMessage(error.message);
  viewer.onLost = (words) => showMessage(words);
  return viewer;
}

// Buttons of which one is pressed. choices: [[value, title]]. A button that stays is the same one: a finger or the
// keyboard may be on it while a newer model comes.
function fillChoices(id, choices, choose) {
  const box = element(id), there = [...box.children];
  box.parentElement.hidden = choices.length === 0;
  const buttons = choices.map(([value, title]) => {
    const button = there.find(({textContent}) => textContent === value) || document.createElement('button');
    button.textContent = value;
    button.title = title || '';
    button.onclick = () => choose(value);
    return button;
  });
  if (buttons.length === there.length && buttons.every((button, i) => button === there[i])) return;
  box.replaceChildren(...buttons);
}

function press(id, value) {
  for (const button of element(id).children) button.setAttribute('aria-pressed', String(button.textContent === value));
}

// A list that was set by pointer leaves the keyboard to the picture; in one of a keyboard's user it stays. Not for the
// field of a colour, whose change WebKit tells while its picker is open.
function giveKeysBack(list) {
  let byPointer = false;
  list.addEventListener('pointerdown', () => { byPointer = true; });
  list.addEventListener('keydown', () => { byPointer = false; });
  list.addEventListener('change', () => {
    if (byPointer) element('picture').focus({preventScroll: true});
  });
}

class Panel {
  constructor(viewer, name) {
    this.viewer = viewer;
    this.name = name;
    this.hasBar = true;
    this.fromAddress = true;  // else the page's address leads to another model
    this.linked = null;  // what the last link leads to, while a word says so
    element('toggle').onclick = () => this.open(element('panel').hidden);
    element('play').onclick = () => this.play();
    element('link').hidden = !HAS_ADDRESS;
    element('link').onclick = () => this.link();
    element('fullscreen').hidden = !document.fullscreenEnabled;
    element('fullscreen').onclick = () => this.fullscreen();
    element('previous').onclick = () => this.step(-1);
    element('next').onclick = () => this.step(1);
    element('frame').onclick = () => viewer.frameAll();
    element('camera').onchange = (event) => this.go(event.target.value);
    element('background').oninput = (event) => {
      const bits = parseInt(event.target.value.slice(1), 16);
      viewer.settings.background = [bits >> 16, bits >> 8 & 255, bits & 255].map((byte) => byte / 255);
      viewer.changed();
    };
    giveKeysBack(element('camera'));
    addEventListener('keydown', (event) => this.key(event));
    viewer.onChange = () => this.update();
    this.open(innerWidth > SMALL[0] && innerHeight > SMALL[1]);
  }

  open(on) {
    element('panel').hidden = !on;
    element('toggle').setAttribute('aria-expanded', String(on));
  }

  // Without the bar there is no panel either: the picture alone.
  showBar(on) {
    this.hasBar = on;
    element('tools').hidden = !on;
    if (!on) this.open(false);
  }

  key(event) {
    const {viewer} = this;
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || !viewer.model) return;
    const {tagName} = event.target;
    if (OWN_KEYS.includes(tagName) || (tagName === 'BUTTON' && (event.key === ' ' || event.key === 'Enter'))) return;
    const {settings} = viewer;
    const output = Object.keys(SHOW)[Number(event.key) - 1];
    const key = event.key.toLowerCase();
    const cycle = (values, value, set) => {
      set(values[(values.indexOf(value) + 1) % values.length]);
      viewer.changed();
    };
    if (output) {
      settings.show = output;
      viewer.changed();
    } else if (key === 't') {
      const values = this.textureChoices().map(([value]) => value);
      if (values.length > 0) cycle(values, settings.textures, (value) => { settings.textures = value; });
    } else if (key === 'i') {
      cycle(Object.keys(INTERSECTIONS), settings.intersection, (value) => { settings.intersection = value; });
    } else if (key === 'f') {
      viewer.frameAll();
    } else if (key === 'h') {
      this.showBar(true);
      this.open(element('panel').hidden);
    } else if (key === 'l') {
      this.play();
    } else if (key === 'c') {
      this.link();
    } else if (key === ' ') {
      this.step(event.shiftKey ? -1 : 1);
    } else if (!moveByKey(viewer, event)) {
      return;
    }
    event.preventDefault();
  }

  // 'v' and the number of a view, or the number of a camera.
  go(value) {
    if (value.startsWith('v')) this.viewer.jumpToView(Number(value.slice(1)));
    else this.viewer.jump(Number(value));
  }

  // To the next view or camera, whichever was looked from last, also where it was left since; views come first.
  step(by) {
    const {viewer} = this;
    const {model: {views, cameras}, last} = viewer;
    const amongViews = views.length > 0 && last.camera < 0;
    const list = amongViews ? views : cameras, from = amongViews ? last.view : last.camera;
    if (list.length === 0) return;
    const to = from < 0 ? (by > 0 ? 0 : list.length - 1) : (from + by + list.length) % list.length;
    if (amongViews) viewer.jumpToView(to);
    else viewer.jump(to);
  }

  play() {
    if (!this.viewer.play(!this.viewer.playing) && this.stops < 2) {
      showMessage('There are no two views to fly through.', 'note');
    }
  }

  // The view and the settings that are not the model's own or that the page's query names, which holds as well, as what
  // stands behind # of an address.
  get words() {
    const {viewer} = this;
    const own = Splats.settingsOf(viewer.model), now = viewer.settings;
    const asked = new URLSearchParams(location.search);
    const words = [`view=${viewer.viewText}`];
    for (const key of ['show', 'textures', 'intersection', 'outside']) {
      if (now[key] !== own[key] || asked.has(key)) words.push(`${key}=${now[key]}`);
    }
    if (String(now.background) !== String(own.background) || asked.has('background')) {
      words.push(`background=${now.background.map((c) => Number(c.toFixed(4))).join(',')}`);
    }
    return words.join('&');
  }

  // The address of this page with all that, and in the clipboard without what only its reader is to have. Of a frame
  // nobody sees the address.
  async link() {
    if (!this.fromAddress) {
      showMessage('No link: this model was dropped on the page, which an address cannot name.', 'note');
      return;
    }
    if (!HAS_ADDRESS) {
      showMessage('This page has no address of its own that a link could lead to.', 'note');
      return;
    }
    const {words} = this;
    const address = `${location.href.split('#')[0]}#${words}`;
    let seen = window === window.top;
    try {
      history.replaceState(null, '', address);
    } catch {  // some browsers do not do so many times in a while
      seen = false;
    }
    const {address: link, kept} = withoutCredentials(address);
    const copied = await Promise.resolve().then(() => navigator.clipboard.writeText(link))
      .then(() => true, () => false);
    this.linked = words;
    const but = kept.length > 0 ? `, but for what looks secret (${kept.join(', ')})` : '';
    if (!copied && (but || !seen)) showMessage(`A link to this view${but}: ${link}`, 'link');
    else if (but) showMessage(`A link to this view is copied${but}.`, 'link');
    else if (!seen) showMessage('A link to this view is copied.', 'done');
    else showMessage(`The address of this page leads to this view now${copied ? ', and is copied' : ''}.`, 'done');
  }

  async fullscreen() {
    try {
      if (document.fullscreenElement) await document.exitFullscreen();
      else await document.documentElement.requestFullscreen();
    } catch (error) {
      showMessage(`No full screen: ${error.message}`);
    }
  }

  // After another model was opened.
  fill() {
    const {model} = this.viewer;
    element('tools').hidden = !this.hasBar;
    element('title').textContent = this.name;
    element('picture').setAttribute('aria-label', `3D view of ${this.name}`);
    this.stops = Math.max(model.views.length, model.cameras.length);
    element('cameras').hidden = this.stops === 0;
    element('play').hidden = this.stops < 2;
    const group = (label, options) => {
      if (options.length === 0) return [];
      const box = document.createElement('optgroup');
      box.label = label;
      box.append(...options);
      return [box];
    };
    const cameras = [
      ...group('views', model.views.map(({name}, index) => new Option(name || `view ${index}`, `v${index}`))),
      ...group('cameras', model.cameras.map(({name, test}, index) =>
        new Option(`${index} ${name}${test ? ' (test)' : ''}`, String(index)))),
      Object.assign(new Option('(free view)', FREE_VIEW), {disabled: true, hidden: true})];
    const list = element('camera');  // stays open while models come
    if (cameras.length !== list.children.length || !cameras.every((box, i) => box.isEqualNode(list.children[i]))) {
      list.replaceChildren(...cameras);
    }
    const set = (key) => (value) => {
      this.viewer.settings[key] = value;
      this.viewer.changed();
    };
    fillChoices('show', Object.keys(SHOW).map((name) => [name]), set('show'));
    fillChoices('textures', this.textureChoices(), set('textures'));
    fillChoices('outside', model.layer ? Object.keys(OUTSIDES).map((name) => [name, OUTSIDE_TITLES[name]]) : [],
                set('outside'));
    fillChoices('intersection', Object.keys(INTERSECTIONS).map((name) => [name]), set('intersection'));
    this.update();
  }

  textureChoices() {
    const {layer} = this.viewer.model;
    if (!layer) return [];
    const possible = Object.keys(TEXTURE_CHOICES).filter((name) => (TEXTURE_CHOICES[name] & ~layer.mode) === 0);
    const titles = {off: 'the base alone', fallback: 'as viewers show it that do not know the textures'};
    return possible.map((name) => [name, titles[name]]);
  }

  facts({count, lod, layer, sh}) {
    const words = (number) => number.toLocaleString('en');
    const gaussians = lod ? `${words(lod.shown)} of ${words(lod.count)}` : words(count);
    return `${gaussians} Gaussians, SH degree ${Math.round(Math.sqrt(sh.length)) - 1}, ` +
      (layer ? `${modeName(layer)} textures` : 'no textures');
  }

  update() {
    const {viewer} = this;
    if (!viewer.model) return;
    const {settings} = viewer;
    element('facts').textContent = this.facts(viewer.model);
    if (this.linked !== null && !viewer.playing && this.linked !== this.words) {  // a flight leaves the word its time
      this.linked = null;
      if (['done', 'link'].includes(element('message').className)) showMessage('');
    }
    press('show', settings.show);
    press('textures', settings.textures);
    press('outside', settings.outside);
    press('intersection', settings.intersection);
    element('play').setAttribute('aria-pressed', String(viewer.playing));
    element('camera').value = viewer.viewIndex >= 0 ? `v${viewer.viewIndex}`
      : viewer.cameraIndex >= 0 ? String(viewer.cameraIndex) : FREE_VIEW;
    const bytes = settings.background.map((c) => Math.round(Math.min(Math.max(c, 0), 1) * 255));
    element('background').value = '#' + bytes.map((byte) => byte.toString(16).padStart(2, '0')).join('');
    if (viewer.moving && viewer.took) element('speed').textContent = `${viewer.took.toFixed(0)} ms`;
  }
}

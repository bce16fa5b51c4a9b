// SPDX-License-Identifier: Apache-2.0
// Draws models with WebGL 2: Gaussians in textures, a quad each, blended back to front into half floats; then the sum as
// a picture, or over what another engine has drawn.
import {breathe} from './breathe.js';
import {dot} from './camera.js';
import {keepingState} from './gl_state.js';
import {GAUSSIAN_NUMBERS, packGaussian, packSh} from './pack.js';
import {SHADERS} from './shaders.js';

export const SHOW = {final: 0, base: 1, texture: 2, alpha: 3, depth: 4, normal: 5, overdraw: 8};  // kOutput* of limits.h
export const TEXELS_PER_GAUSSIAN = GAUSSIAN_NUMBERS / 4;
export const BLOCK_BYTES = 1 << 20;  // uploaded at a time
const UNITS = {u_gaussians: 0, u_sh: 1, u_rects: 2, u_ranges: 3, u_atlas: 4, u_sum: 5, u_order: 6};
// Quads in one instance. Of four vertices alone an instance is a draw of its own to software drivers, and on GPUs leaves
// most of a wave empty.
const BATCH = 2048;
const PATIENCE = 5;  // [ms]

// A model in the device's memory, and how it is drawn unless told otherwise.
export class GpuModel {
  // What each Gaussian has: `shCoefficients` without the first one, `mode` of its texture (kMode*).
  constructor(gl, {count, shCoefficients, mode}, perRow, rows) {
    Object.assign(this, {gl, perRow, rows, count, shCoefficients, mode});
    this.textures = {};
    this.corners = gl.createBuffer();
    this.array = gl.createVertexArray();
    this.visible = 0;
  }

  // Room for the order of all, a row a batch.
  openOrder(renderer) {
    const {gl} = this;
    renderer.newTexture(this.textures, 'u_order', gl.TEXTURE_2D, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R32UI, BATCH, Math.ceil(this.count / BATCH));
    const corners = new Uint16Array(6 * BATCH);
    for (let i = 0; i < BATCH; ++i) for (let k = 0; k < 6; ++k) corners[6 * i + k] = 4 * i + (k < 3 ? k : 6 - k);
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }

  dispose() {
    for (const texture of Object.values(this.textures)) this.gl.deleteTexture(texture);
    this.gl.deleteBuffer(this.corners);
    this.gl.deleteVertexArray(this.array);
    this.textures = {};
    this.visible = 0;
  }
}

export class SplatRenderer {
  // `shared`: another engine draws with this context, too.
  constructor(gl, {shared = false} = {}) {
    this.gl = gl;
    this.guarded = shared ? (body) => keepingState(gl, Object.values(UNITS), body) : (body) => body();
    // Sums of signed textures need more than 8 bits and a sign; without float targets negative texels are cut.
    this.deep = Boolean(gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float'));
    // Depths want more digits than half floats have.
    this.precise = Boolean(gl.getExtension('EXT_color_buffer_float') && gl.getExtension('EXT_float_blend'));
    this.parallel = gl.getExtension('KHR_parallel_shader_compile');
    this.splat = this.program('splat.vert', 'splat.frag');
    this.resolve = this.program('resolve.vert', 'resolve.frag');
    this.emptyArray = gl.createVertexArray();
    this.target = null;
    this.users = 0;  // models that are drawn with it
    this.ready = null;
    this.drawing = null;  // a fence behind the last draw()
  }

  program(vertex, fragment) {
    const {gl} = this;
    const program = gl.createProgram();
    const shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map(([type, name]) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, SHADERS[name]);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    });
    gl.linkProgram(program);
    return {program, shaders, uniforms: {}};
  }

  // Whether the context has been lost since, though it may be there again.
  get lost() { return !this.gl.isProgram(this.splat.program); }

  // Resolves when the programs are linked, which is waited for without asking the driver to hurry.
  linked() {
    this.ready = this.ready || Promise.all([this.splat, this.resolve].map((part) => this.link(part)))
      .then(() => this.finished()).then(() => this.guarded(() => this.tryTarget()));
    return this.ready;
  }

  async link({program, shaders, uniforms}) {
    const {gl} = this;
    if (this.parallel) {
      while (!gl.isContextLost() && !gl.getProgramParameter(program, this.parallel.COMPLETION_STATUS_KHR)) {
        await new Promise((done) => setTimeout(done, PATIENCE));
      }
    }
    if (gl.isContextLost()) return;
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      const words = [...shaders.map((shader) => gl.getShaderInfoLog(shader)), gl.getProgramInfoLog(program)];
      throw new Error(`The shaders do not compile here: ${words.filter(Boolean).join(' ')}`);
    }
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const {name} = gl.getActiveUniform(program, i);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
  }

  // The model on the device. Throws where it does not fit.
  async upload(model) {
    await this.linked();
    const {gl} = this;
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const perRow = Math.min(model.count, Math.floor(side / Math.max(TEXELS_PER_GAUSSIAN, model.sh.length - 1)));
    const rows = Math.ceil(model.count / perRow);
    if (rows > side) throw new Error(`${model.count} Gaussians are too many for this device (at most ${perRow * side})`);
    const kind = {count: model.count, shCoefficients: model.sh.length - 1, mode: model.layer ? model.layer.mode : 0};
    const gpu = new GpuModel(gl, kind, perRow, rows);
    const steps = this.uploadSteps(gpu, model, side);
    try {
      await this.finished();  // before asking for errors, here and below: that waits for all that was sent
      while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
      while (!this.guarded(() => steps.next()).done) await breathe();
      await this.finished();
      if (gl.getError() !== gl.NO_ERROR) throw new Error('the model does not fit into the memory of the graphics device');
    } catch (error) {
      gpu.dispose();
      throw error;
    }
    return gpu;
  }

  // Resolves when the device has done what it was told.
  async finished() {
    const {gl} = this;
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    while (!gl.isContextLost() && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) {
      await new Promise((done) => setTimeout(done, PATIENCE));
    }
    gl.deleteSync(fence);
  }

  // A texture on its unit, bound for filling.
  newTexture(textures, name, target, filter) {
    const {gl} = this;
    textures[name] = gl.createTexture();
    this.bind(textures, name, target);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, key, filter);
    for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, key, gl.CLAMP_TO_EDGE);
  }

  bind(textures, name, target) {
    const {gl} = this;
    gl.activeTexture(gl.TEXTURE0 + UNITS[name]);
    gl.bindTexture(target, textures[name] || null);
  }

  // What gpu shows from now on: Gaussian indices, farthest first.
  setOrder(gpu, order, visible) {
    const {gl} = this;
    this.guarded(() => {
      this.bind(gpu.textures, 'u_order', gl.TEXTURE_2D);
      const rows = Math.floor(visible / BATCH), rest = visible % BATCH;
      const put = (row, width, height) => gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, width, height, gl.RED_INTEGER,
                                                           gl.UNSIGNED_INT, order, BATCH * row);
      if (rows > 0) put(0, BATCH, rows);
      if (rest > 0) put(rows, rest, 1);
    });
    gpu.visible = visible;
  }

  // After each step others may have the context.
  *uploadSteps(gpu, model, side) {
    const {gl} = this;
    const {layer} = model;
    const float = [gl.RGBA32F, gl.RGBA, gl.FLOAT, Float32Array];
    yield* this.uploadRows(gpu, 'u_gaussians', TEXELS_PER_GAUSSIAN, 4, float,
                           (i, out, at) => packGaussian(model, i, out, at));
    if (gpu.shCoefficients > 0) {
      const half = [gl.RGB16F, gl.RGB, gl.FLOAT, Float32Array];
      yield* this.uploadRows(gpu, 'u_sh', gpu.shCoefficients, 3, half, (i, out, at) => packSh(model, i, out, at));
    }
    if (layer) {
      const integers = [gl.RGBA16UI, gl.RGBA_INTEGER, gl.UNSIGNED_SHORT, Uint16Array];
      yield* this.uploadRows(gpu, 'u_rects', 1, 4, integers, (i, out, at) => {
        for (let k = 0; k < 4; ++k) out[at + k] = layer.rects[4 * i + k];
      });
      yield* this.uploadAtlases(gpu, layer.atlases, side);
    }
    gpu.openOrder(this);
  }

  // `width` texels of `channels` numbers a Gaussian; fill(i, out, at) writes those of Gaussian i.
  *uploadRows(gpu, name, width, channels, [internal, format, type, Kind], fill) {
    const {gl} = this;
    const rowTexels = gpu.perRow * width;
    const blockRows = Math.max(Math.floor(BLOCK_BYTES / (rowTexels * channels * Kind.BYTES_PER_ELEMENT)), 1);
    const block = new Kind(rowTexels * channels * Math.min(blockRows, gpu.rows));
    for (let row = 0; row < gpu.rows; row += blockRows) {
      if (row === 0) {
        this.newTexture(gpu.textures, name, gl.TEXTURE_2D, gl.NEAREST);
        gl.texStorage2D(gl.TEXTURE_2D, 1, internal, rowTexels, gpu.rows);
      } else {
        this.bind(gpu.textures, name, gl.TEXTURE_2D);
      }
      const rows = Math.min(blockRows, gpu.rows - row);
      const first = row * gpu.perRow, last = Math.min(first + rows * gpu.perRow, gpu.count);
      for (let i = first; i < last; ++i) fill(i, block, (i - first) * width * channels);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, rowTexels, rows, format, type, block);
      yield;
    }
  }

  *uploadAtlases(gpu, atlases, side) {
    const {gl} = this;
    this.newTexture(gpu.textures, 'u_ranges', gl.TEXTURE_2D, gl.NEAREST);
    const ranges = new Float32Array(atlases.flatMap(({scale, offset}) => [...scale, ...offset]));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2, atlases.length, 0, gl.RGBA, gl.FLOAT, ranges);
    const width = Math.max(...atlases.map((atlas) => atlas.width));
    const height = Math.max(...atlases.map((atlas) => atlas.height));
    if (Math.max(width, height) > side) {
      throw new Error(`an atlas of ${width} x ${height} texels is too large for this device`);
    }
    if (atlases.length > gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS)) {
      throw new Error(`${atlases.length} atlases are too many for this device`);
    }
    const deep = atlases.some((atlas) => atlas.deep);
    this.newTexture(gpu.textures, 'u_atlas', gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, deep ? gl.RGBA16F : gl.RGBA8, width, height, atlases.length);
    const type = deep ? gl.FLOAT : gl.UNSIGNED_BYTE;
    for (const [page, atlas] of atlases.entries()) {
      const bandRows = Math.max(Math.floor(BLOCK_BYTES / (4 * atlas.width * (deep ? 4 : 1))), 1);
      for (let row = 0; row < atlas.height; row += bandRows) {
        const rows = Math.min(bandRows, atlas.height - row);
        const band = atlas.texels.subarray(4 * atlas.width * row, 4 * atlas.width * (row + rows));
        const texels = deep && !atlas.deep ? Float32Array.from(band, (byte) => byte / 255) : band;
        this.bind(gpu.textures, 'u_atlas', gl.TEXTURE_2D_ARRAY);
        gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, row, page, atlas.width, rows, 1, gl.RGBA, type, texels);
        yield;
      }
    }
  }

  // A picture to sum into, of at least 16 bits a channel where the device can. `depth`: a format of a depth buffer, or
  // 0; `precise`: of 32 bits.
  sizeTarget(width, height, depth, precise = false) {
    const {gl, target} = this;
    const format = precise ? gl.RGBA32F : this.deep ? gl.RGBA16F : gl.RGBA8;
    const same = target && target.width === width && target.height === height;
    if (same && target.depth === depth && target.format === format) return;
    this.dropTarget();
    this.target = {width, height, depth, format, framebuffer: gl.createFramebuffer(), buffer: null};
    this.newTexture(this.target, 'u_sum', gl.TEXTURE_2D, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.target.u_sum, 0);
    if (depth) {
      this.target.buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, this.target.buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, depth, width, height);
      const stencil = depth === gl.DEPTH24_STENCIL8 || depth === gl.DEPTH32F_STENCIL8;
      const place = stencil ? gl.DEPTH_STENCIL_ATTACHMENT : gl.DEPTH_ATTACHMENT;
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, this.target.buffer);
      gl.bindRenderbuffer(gl.RENDERBUFFER, null);
    }
  }

  // Once, as asking waits for the device: whether a target can be drawn into.
  tryTarget() {
    const {gl} = this;
    this.sizeTarget(1, 1, 0);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
      throw new Error('This device cannot draw into half floats.');
    }
  }

  dropTarget() {
    const {gl, target} = this;
    if (!target) return;
    gl.deleteTexture(target.u_sum);
    gl.deleteRenderbuffer(target.buffer);
    gl.deleteFramebuffer(target.framebuffer);
    this.target = null;
  }

  use({program, uniforms}, values) {
    const {gl} = this;
    gl.useProgram(program);
    for (const [name, [method, ...args]] of Object.entries(values)) {
      if (uniforms[name] !== undefined) gl[method](uniforms[name], ...args);
    }
    for (const [name, unit] of Object.entries(UNITS)) {
      if (uniforms[name] !== undefined) gl.uniform1i(uniforms[name], unit);
    }
  }

  // The weighted sum of what is seen into the target, which is bound and has its size. `camera` has the size of the
  // picture. settings: {show, textures: kMode* mask, fallback, intersection, outside}; origin: [px] of the picture in
  // the target; depth: [a, b], a normalised depth is a + b / camera z, null: none is tested.
  sum(gpu, camera, settings, origin, depth) {
    const {gl} = this;
    const {axes: [x, y, z], eye} = camera;
    const show = SHOW[settings.show];
    gl.viewport(origin[0], origin[1], camera.width, camera.height);
    for (const test of [gl.SCISSOR_TEST, gl.CULL_FACE, gl.STENCIL_TEST, gl.POLYGON_OFFSET_FILL,
                        gl.SAMPLE_ALPHA_TO_COVERAGE]) {
      gl.disable(test);
    }
    gl.colorMask(true, true, true, true);
    gl.depthMask(false);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.enable(gl.BLEND);
    gl.blendEquation(gl.FUNC_ADD);
    gl.blendFunc(gl.ONE, show === SHOW.overdraw ? gl.ONE : gl.ONE_MINUS_SRC_ALPHA);
    if (depth) {
      gl.enable(gl.DEPTH_TEST);
      gl.depthFunc(depth[1] > 0 ? gl.GEQUAL : gl.LEQUAL);  // greater is nearer where the buffer is reversed
    } else {
      gl.disable(gl.DEPTH_TEST);
    }
    for (const name of ['u_gaussians', 'u_sh', 'u_rects', 'u_ranges', 'u_order']) this.bind(gpu.textures, name, gl.TEXTURE_2D);
    this.bind(gpu.textures, 'u_atlas', gl.TEXTURE_2D_ARRAY);
    this.use(this.splat, {
      u_visible: ['uniform1i', gpu.visible],
      u_per_row: ['uniform1i', gpu.perRow],
      u_sh_coefficients: ['uniform1i', gpu.shCoefficients],
      u_camera_from_world: ['uniformMatrix3fv', false, [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]]],
      u_eye: ['uniform3f', ...eye],
      u_eye_rest: ['uniform3f', ...eye.map((at) => at - Math.fround(at))],
      u_focal_center: ['uniform4f', camera.fx, camera.fy, camera.cx, camera.cy],
      u_size: ['uniform2f', camera.width, camera.height],
      u_origin: ['uniform2f', ...origin],
      u_depth: ['uniform2f', ...(depth || [0, 0])],
      u_texture_mode: ['uniform1ui', settings.fallback ? 0 : gpu.mode & settings.textures],
      u_intersection: ['uniform1ui', settings.intersection],
      u_outside: ['uniform1ui', settings.outside],
      u_show: ['uniform1ui', show],
      u_fallback: ['uniform1i', settings.fallback ? 1 : 0],
    });
    gl.bindVertexArray(gpu.array);
    gl.drawElementsInstanced(gl.TRIANGLES, 6 * Math.min(gpu.visible, BATCH), gl.UNSIGNED_SHORT, 0,
                             Math.ceil(gpu.visible / BATCH));
    gl.disable(gl.DEPTH_TEST);
  }

  // The sum as a picture on the framebuffer that is bound. picture: {perPixel: sums a pixel, show, background,
  // depthRange} or {over: true, linear}.
  show({perPixel = [1, 1], show = 'final', background = [0, 0, 0], depthRange = [0, 1], over = false, linear = false}) {
    const {gl} = this;
    this.bind(this.target, 'u_sum', gl.TEXTURE_2D);
    this.use(this.resolve, {
      u_sum_per_pixel: ['uniform2f', ...perPixel],
      u_background: ['uniform3f', ...background],
      u_depth_range: ['uniform2f', ...depthRange],
      u_show: ['uniform1ui', SHOW[show]],
      u_over: ['uniform1i', over ? 1 : 0],
      u_linear: ['uniform1i', linear ? 1 : 0],
    });
    gl.bindVertexArray(this.emptyArray);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
  }

  // On the whole canvas, whose size may be larger than the camera's. settings: also background and depthRange.
  draw(gpu, camera, settings) {
    const {gl} = this;
    this.sizeTarget(camera.width, camera.height, 0, this.precise && settings.show === 'depth');
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    this.sum(gpu, camera, settings, [0, 0], null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.disable(gl.BLEND);
    this.show({...settings, perPixel: [camera.width / gl.canvas.width, camera.height / gl.canvas.height]});
    gl.deleteSync(this.drawing);
    this.drawing = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  // Whether the device has done the last draw().
  get idle() {
    const {gl} = this;
    const asked = this.drawing && !gl.isContextLost();
    if (asked && gl.clientWaitSync(this.drawing, 0, 0) === gl.TIMEOUT_EXPIRED) return false;
    gl.deleteSync(this.drawing);
    this.drawing = null;
    return true;
  }

  dispose() {
    const {gl} = this;
    gl.deleteSync(this.drawing);
    this.dropTarget();
    for (const {program, shaders} of [this.splat, this.resolve]) {
      for (const shader of shaders) gl.deleteShader(shader);
      gl.deleteProgram(program);
    }
    gl.deleteVertexArray(this.emptyArray);
  }
}

// SPDX-License-Identifier: Apache-2.0
// Draws a model with WebGL 2: Gaussians in textures, one instanced quad each, blended back to front into half floats.
'use strict';

const SHOW = {final: 0, base: 1, texture: 2, alpha: 3, depth: 4, normal: 5, overdraw: 8};  // kOutput* of limits.h
const TEXELS_PER_GAUSSIAN = 5;
const UPLOAD_ROWS = 64;
const UNITS = {u_gaussians: 0, u_sh: 1, u_rects: 2, u_ranges: 3, u_atlas: 4, u_sum: 5};

class SplatRenderer {
  // `sources`: a function from a shader's file name to its text.
  constructor(canvas, sources) {
    this.gl = canvas.getContext('webgl2', {alpha: false, antialias: false, depth: false, stencil: false,
                                           powerPreference: 'high-performance'});
    if (!this.gl) throw new Error('This browser offers no WebGL 2, which the picture needs.');
    const gl = this.gl;
    // Sums of signed textures need more than 8 bits and a sign; without float targets negative texels are cut.
    this.deep = Boolean(gl.getExtension('EXT_color_buffer_float') || gl.getExtension('EXT_color_buffer_half_float'));
    this.splat = this.program(sources('splat.vert'), sources('splat.frag'));
    this.resolve = this.program(sources('resolve.vert'), sources('resolve.frag'));
    this.order = gl.createBuffer();
    this.splatArray = gl.createVertexArray();
    this.emptyArray = gl.createVertexArray();
    this.textures = {};
    this.target = null;
    this.visible = 0;
  }

  program(vertex, fragment) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`A shader does not compile here: ${gl.getShaderInfoLog(shader)}`);
      }
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`The shaders do not link here: ${gl.getProgramInfoLog(program)}`);
    }
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); ++i) {
      const {name} = gl.getActiveUniform(program, i);
      uniforms[name] = gl.getUniformLocation(program, name);
    }
    return {program, uniforms};
  }

  // A texture on its unit, bound for filling.
  newTexture(name, target, filter) {
    const gl = this.gl;
    gl.deleteTexture(this.textures[name] || null);
    this.textures[name] = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0 + UNITS[name]);
    gl.bindTexture(target, this.textures[name]);
    for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(target, key, filter);
    for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(target, key, gl.CLAMP_TO_EDGE);
  }

  // `width` texels of `channels` numbers a Gaussian; fill(i, out, at) writes those of Gaussian i.
  uploadRows(name, model, width, channels, internal, format, type, Kind, fill) {
    const gl = this.gl;
    this.newTexture(name, gl.TEXTURE_2D, gl.NEAREST);
    const rowTexels = this.perRow * width;
    gl.texStorage2D(gl.TEXTURE_2D, 1, internal, rowTexels, this.rows);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const block = new Kind(rowTexels * channels * Math.min(UPLOAD_ROWS, this.rows));
    for (let row = 0; row < this.rows; row += UPLOAD_ROWS) {
      const rows = Math.min(UPLOAD_ROWS, this.rows - row);
      const first = row * this.perRow, last = Math.min(first + rows * this.perRow, model.count);
      for (let i = first; i < last; ++i) fill(i, block, (i - first) * width * channels);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, rowTexels, rows, format, type, block);
    }
  }

  setModel(model) {
    const gl = this.gl;
    const side = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    const {layer} = model;
    this.model = model;
    this.visible = 0;
    this.shCoefficients = model.sh.length - 1;
    this.perRow = Math.min(model.count, Math.floor(side / Math.max(TEXELS_PER_GAUSSIAN, this.shCoefficients)));
    this.rows = Math.ceil(model.count / this.perRow);
    if (this.rows > side) {
      throw new Error(`${model.count} Gaussians are too many for this device (at most ${this.perRow * side})`);
    }
    while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
    const opacity = (layer && layer.opacity) || model.opacity;
    const dc = (layer && layer.dc) || model.sh[0];
    this.uploadRows('u_gaussians', model, TEXELS_PER_GAUSSIAN, 4, gl.RGBA32F, gl.RGBA, gl.FLOAT, Float32Array,
      (i, out, at) => {
        for (let k = 0; k < 3; ++k) {
          out[at + k] = model.mean[3 * i + k];
          out[at + 8 + k] = model.scale[3 * i + k];
          out[at + 12 + k] = dc[3 * i + k];
          out[at + 16 + k] = model.sh[0][3 * i + k];
        }
        for (let k = 0; k < 4; ++k) out[at + 4 + k] = model.rotation[4 * i + k];
        out[at + 3] = opacity[i];
        out[at + 11] = layer && layer.pages ? layer.pages[i] : 0;
        out[at + 19] = model.opacity[i];
      });
    if (this.shCoefficients > 0) {
      this.uploadRows('u_sh', model, this.shCoefficients, 3, gl.RGB16F, gl.RGB, gl.FLOAT, Float32Array,
        (i, out, at) => {
          for (let c = 0; c < this.shCoefficients; ++c) {
            for (let k = 0; k < 3; ++k) out[at + 3 * c + k] = model.sh[c + 1][3 * i + k];
          }
        });
    }
    if (layer) this.uploadLayer(model, layer);
    if (gl.getError() !== gl.NO_ERROR) throw new Error('the model does not fit into the memory of the graphics device');
    gl.bindVertexArray(this.splatArray);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * model.count, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(0, 1);
  }

  uploadLayer(model, layer) {
    const gl = this.gl;
    const {atlases} = layer;
    this.uploadRows('u_rects', model, 1, 4, gl.RGBA16UI, gl.RGBA_INTEGER, gl.UNSIGNED_SHORT, Uint16Array,
      (i, out, at) => {
        for (let k = 0; k < 4; ++k) out[at + k] = layer.rects[4 * i + k];
      });
    this.newTexture('u_ranges', gl.TEXTURE_2D, gl.NEAREST);
    const ranges = new Float32Array(atlases.flatMap(({scale, offset}) => [...scale, ...offset]));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2, atlases.length, 0, gl.RGBA, gl.FLOAT, ranges);
    const width = Math.max(...atlases.map((atlas) => atlas.width));
    const height = Math.max(...atlases.map((atlas) => atlas.height));
    if (Math.max(width, height) > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
      throw new Error(`an atlas of ${width} x ${height} texels is too large for this device`);
    }
    const deep = atlases.some((atlas) => atlas.deep);
    this.newTexture('u_atlas', gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, deep ? gl.RGBA16F : gl.RGBA8, width, height, atlases.length);
    atlases.forEach((atlas, page) => {
      const texels = deep && !atlas.deep ? Float32Array.from(atlas.texels, (byte) => byte / 255) : atlas.texels;
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, page, atlas.width, atlas.height, 1, gl.RGBA,
                       deep ? gl.FLOAT : gl.UNSIGNED_BYTE, texels);
    });
  }

  // Gaussian indices, farthest first.
  setOrder(order, visible) {
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, order, 0, visible);
    this.visible = visible;
  }

  // A picture to sum into, of at least 16 bits a channel where the device can.
  sizeTarget(width, height) {
    const gl = this.gl;
    if (this.target && this.target.width === width && this.target.height === height) return;
    this.newTexture('u_sum', gl.TEXTURE_2D, gl.NEAREST);
    gl.texStorage2D(gl.TEXTURE_2D, 1, this.deep ? gl.RGBA16F : gl.RGBA8, width, height);
    if (!this.target) this.target = {framebuffer: gl.createFramebuffer()};
    Object.assign(this.target, {width, height});
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.textures.u_sum, 0);
    if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
      throw new Error('This device cannot draw into half floats.');
    }
  }

  use({program, uniforms}, values) {
    const gl = this.gl;
    gl.useProgram(program);
    for (const [name, [method, ...args]] of Object.entries(values)) {
      if (uniforms[name] !== undefined) gl[method](uniforms[name], ...args);
    }
    for (const [name, unit] of Object.entries(UNITS)) {
      if (uniforms[name] !== undefined) gl.uniform1i(uniforms[name], unit);
    }
  }

  // `camera` has the size of the sums, the canvas may be larger. settings: {show, textures: kMode* mask, fallback,
  // intersection, outside, background, depthRange}.
  draw(camera, settings) {
    const gl = this.gl;
    const {axes: [x, y, z], eye} = camera;
    const show = SHOW[settings.show];
    const mode = this.model.layer && !settings.fallback ? this.model.layer.mode & settings.textures : 0;
    this.sizeTarget(camera.width, camera.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    gl.viewport(0, 0, camera.width, camera.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, show === SHOW.overdraw ? gl.ONE : gl.ONE_MINUS_SRC_ALPHA);
    this.use(this.splat, {
      u_per_row: ['uniform1i', this.perRow],
      u_sh_coefficients: ['uniform1i', this.shCoefficients],
      u_camera_from_world: ['uniformMatrix3fv', false,
                            [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]]],
      u_translation: ['uniform3f', -dot(x, eye), -dot(y, eye), -dot(z, eye)],
      u_eye: ['uniform3f', ...eye],
      u_focal_center: ['uniform4f', camera.fx, camera.fy, camera.cx, camera.cy],
      u_size: ['uniform2f', camera.width, camera.height],
      u_texture_mode: ['uniform1ui', mode],
      u_intersection: ['uniform1ui', settings.intersection],
      u_outside: ['uniform1ui', settings.outside],
      u_show: ['uniform1ui', show],
      u_fallback: ['uniform1i', settings.fallback ? 1 : 0],
    });
    gl.bindVertexArray(this.splatArray);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.visible);

    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    gl.disable(gl.BLEND);
    this.use(this.resolve, {
      u_sum_per_pixel: ['uniform2f', camera.width / gl.canvas.width, camera.height / gl.canvas.height],
      u_background: ['uniform3f', ...settings.background],
      u_depth_range: ['uniform2f', ...settings.depthRange],
      u_show: ['uniform1ui', show],
    });
    gl.bindVertexArray(this.emptyArray);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

// SPDX-License-Identifier: Apache-2.0
// A context that another engine draws with, too: what we bind is bound as before afterwards, and its depth is copied.

// Runs `body` and leaves bindings, the tests that are on, masks and ways to unpack pixels as they were. Values of
// blending and depth are left as SplatRenderer.sum() sets them: asking for those waits for the device, and engines
// know better (see the adapters). `units`: texture units in use.
export function keepingState(gl, units, body) {
  const get = (name) => gl.getParameter(name);
  const draw = get(gl.DRAW_FRAMEBUFFER_BINDING), read = get(gl.READ_FRAMEBUFFER_BINDING);
  const program = get(gl.CURRENT_PROGRAM), array = get(gl.VERTEX_ARRAY_BINDING), buffer = get(gl.ARRAY_BUFFER_BINDING);
  const unpack = get(gl.PIXEL_UNPACK_BUFFER_BINDING), active = get(gl.ACTIVE_TEXTURE);
  const renderbuffer = get(gl.RENDERBUFFER_BINDING), colorMask = get(gl.COLOR_WRITEMASK);
  const tests = [gl.SCISSOR_TEST, gl.CULL_FACE, gl.STENCIL_TEST, gl.POLYGON_OFFSET_FILL,
                 gl.SAMPLE_ALPHA_TO_COVERAGE, gl.BLEND, gl.DEPTH_TEST];
  const on = tests.map((test) => gl.isEnabled(test));
  const stores = [gl.UNPACK_ALIGNMENT, gl.UNPACK_FLIP_Y_WEBGL, gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, gl.UNPACK_ROW_LENGTH,
                  gl.UNPACK_SKIP_ROWS, gl.UNPACK_SKIP_PIXELS, gl.UNPACK_IMAGE_HEIGHT, gl.UNPACK_SKIP_IMAGES];
  const stored = stores.map(get);
  const bound = units.map((unit) => {
    gl.activeTexture(gl.TEXTURE0 + unit);
    const found = [get(gl.TEXTURE_BINDING_2D), get(gl.TEXTURE_BINDING_2D_ARRAY), get(gl.SAMPLER_BINDING)];
    gl.bindSampler(unit, null);
    return found;
  });
  gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
  gl.bindVertexArray(null);
  stores.forEach((store, i) => gl.pixelStorei(store, i === 0 ? 1 : 0));
  try {
    return body();
  } finally {
    units.forEach((unit, i) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, bound[i][0]);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, bound[i][1]);
      gl.bindSampler(unit, bound[i][2]);
    });
    stores.forEach((store, i) => gl.pixelStorei(store, stored[i]));
    tests.forEach((test, i) => (on[i] ? gl.enable(test) : gl.disable(test)));
    gl.colorMask(...colorMask);
    gl.activeTexture(active);
    gl.useProgram(program);
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, unpack);
    gl.bindRenderbuffer(gl.RENDERBUFFER, renderbuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, draw);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
  }
}

const facts = new WeakMap();  // of framebuffers, and of contexts for their own one

// {depth: its formats, the likeliest first, linear: whether its numbers are light rather than sRGB} of the framebuffer
// that is bound for drawing. Asked once each.
function factsOf(gl, framebuffer) {
  const known = facts.get(framebuffer || gl);
  if (known) return known;
  const ask = (place, name) => gl.getFramebufferAttachmentParameter(gl.DRAW_FRAMEBUFFER, place, name);
  let depth = [], linear = false;
  if (!framebuffer) {
    const wanted = gl.getContextAttributes();
    if (wanted.depth) depth = [gl.DEPTH24_STENCIL8, gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT16];
  } else {
    const has = (place) => ask(place, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) !== gl.NONE;
    if (has(gl.COLOR_ATTACHMENT0)) {
      linear = ask(gl.COLOR_ATTACHMENT0, gl.FRAMEBUFFER_ATTACHMENT_COMPONENT_TYPE) === gl.FLOAT;
    }
    if (has(gl.DEPTH_ATTACHMENT)) {
      const stencil = has(gl.STENCIL_ATTACHMENT);
      const bits = ask(gl.DEPTH_ATTACHMENT, gl.FRAMEBUFFER_ATTACHMENT_DEPTH_SIZE);
      if (bits === 32) depth = [stencil ? gl.DEPTH32F_STENCIL8 : gl.DEPTH_COMPONENT32F];
      else if (bits === 16) depth = [gl.DEPTH_COMPONENT16];
      else depth = [stencil ? gl.DEPTH24_STENCIL8 : gl.DEPTH_COMPONENT24];
    }
  }
  const found = {depth, linear};
  facts.set(framebuffer || gl, found);
  return found;
}

// Draws over the framebuffer that is bound, hidden by what is nearer in it. view: {camera, origin [px], depth: as in
// SplatRenderer.sum(), linear: undefined where the framebuffer tells}.
export function drawOver(renderer, gpu, {camera, origin = [0, 0], depth = null, linear}, settings) {
  const {gl} = renderer;
  renderer.guarded(() => {
    const framebuffer = gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING);
    const known = factsOf(gl, framebuffer);
    const scissored = gl.isEnabled(gl.SCISSOR_TEST);
    gl.disable(gl.SCISSOR_TEST);
    // Never smaller than before: several views a frame share it.
    const {width: w = 0, height: h = 0} = renderer.target || {};
    const width = Math.max(origin[0] + camera.width, w), height = Math.max(origin[1] + camera.height, h);
    const area = [0, 0, origin[0] + camera.width, origin[1] + camera.height];
    // A copy of the depth, in the framebuffer's own format; the first time one is found that the driver takes.
    while (depth && known.depth.length > 0) {
      renderer.sizeTarget(width, height, known.depth[0]);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, framebuffer);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, renderer.target.framebuffer);
      if (!known.tried) while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
      gl.blitFramebuffer(...area, ...area, gl.DEPTH_BUFFER_BIT, gl.NEAREST);
      if (known.tried || gl.getError() === gl.NO_ERROR) break;
      known.depth.shift();
    }
    if (depth) known.tried = true;
    const tested = Boolean(depth) && known.depth.length > 0;
    if (!tested) renderer.sizeTarget(width, height, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, renderer.target.framebuffer);
    renderer.sum(gpu, camera, settings, origin, tested ? depth : null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    if (scissored) gl.enable(gl.SCISSOR_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    renderer.show({over: true, linear: linear === undefined ? known.linear : linear});
  });
}

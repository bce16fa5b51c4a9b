// SPDX-License-Identifier: Apache-2.0
// From a camera and settings to the view of the passes, and from their buffers to a frame.
#include "render/gpu/gpu_renderer.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <new>
#include <type_traits>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "shared/layout.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr std::uint32_t kFirstPairCapacity = 1u << 16;
constexpr std::uint32_t kFirstPairsPerGaussian = 4;

std::uint32_t textureModeOf(const ModelBuffers& model, const RenderSettings& settings) {
  return static_cast<std::uint32_t>(model.texture_mode) & static_cast<std::uint32_t>(settings.textures);
}

ViewUniforms viewOf(const Camera& camera, const RenderSettings& settings, const ModelBuffers& model,
                    const ImageBuffers& image, const OutputRange& beside) {
  ViewUniforms view{};
  glm::dmat4 camera_from_world(camera.rotation);
  camera_from_world[3] = glm::dvec4(camera.translation, 1.0);
  view.camera_from_world = glm::mat4(camera_from_world);
  const glm::dvec3 position = camera.position(), forward = glm::row(camera.rotation, 2);
  view.camera_position = glm::vec4(glm::vec3(position), 0.0f);
  view.position_rest = glm::vec4(glm::vec3(position - glm::dvec3(glm::vec3(position))), 0.0f);
  view.forward_rest = glm::vec4(glm::vec3(forward - glm::dvec3(glm::vec3(forward))), 0.0f);
  view.focal_center = focalCenter(camera);
  view.background = glm::vec4(settings.background, 0.0f);
  view.width = image.width;
  view.height = image.height;
  view.tiles_x = image.tilesX();
  view.tiles_y = image.tilesY();
  view.gaussian_count = model.gaussian_count;
  view.sh_degree = model.sh_degree;
  view.texture_mode = textureModeOf(model, settings);
  view.intersection = static_cast<std::uint32_t>(settings.intersection.value_or(model.intersection));
  const CropBox crop = settings.crop.value_or(CropBox{});
  view.crop_min = glm::vec4(crop.min, settings.crop ? 1.0f : 0.0f);
  view.crop_max = glm::vec4(crop.max, 0.0f);
  view.opacity_scale = settings.opacity_scale;
  view.splat_scale = settings.splat_scale;
  view.near = settings.near;
  view.exposure = std::exp2(settings.exposure);
  view.sh_used = std::min(model.sh_degree, static_cast<std::uint32_t>(settings.max_sh_degree));
  view.antialiasing = settings.antialiasing == Antialiasing::screen;
  view.range_least = beside.least;
  view.range_most = beside.most;
  return view;
}

void addTimes(std::vector<PassTime>& sums, const std::vector<PassTime>& times) {
  for (const PassTime& time : times) {
    const auto sum = std::ranges::find(sums, time.name, &PassTime::name);
    if (sum == sums.end()) {
      sums.push_back(time);
    } else {
      sum->milliseconds += time.milliseconds;
    }
  }
}

}  // namespace

GpuRenderer::GpuRenderer(std::unique_ptr<GpuDevice> device, const PassTuning& tuning)
    : device_(std::move(device)),
      tuning_(tuning),
      scratch_(*device_),
      counters_(device_->makeBuffer("counters", sizeof(Counters))) {}

void GpuRenderer::setModel(const GaussianModel& model) {
  program_.reset();
  pairs_.reset();
  splats_.reset();
  model_.reset();
  model_ = uploadModel(*device_, model, precision_);
  splats_.emplace(*device_, model_->gaussian_count);
  const std::uint64_t wish = std::max<std::uint64_t>(kFirstPairCapacity, kFirstPairsPerGaussian * model.size());
  pair_room_ = static_cast<std::uint32_t>(std::min<std::uint64_t>(wish, maxPairCapacity(device_->limits(), tuning_)));
  makeFirstPairs();
}

Frame GpuRenderer::render(const Camera& camera, const RenderSettings& settings) {
  checkFrame(camera, settings);
  const int rows = rowsAtOnce(camera);
  if (rows < camera.size.y) return renderBands(camera, settings, rows);
  try {
    return renderWhole(camera, settings);
  } catch (const DoesNotFit&) {
    if (!canBeCut(rows)) throw;
  } catch (const std::bad_alloc&) {  // what a software driver calls its memory
    if (!canBeCut(rows)) throw;
  }
  return renderBands(camera, settings, halfOfRows(rows));
}

Frame GpuRenderer::renderWhole(const Camera& camera, const RenderSettings& settings) {
  FrameVariant variant = variantFor(settings.outputs);
  OutputSet outputs = settings.outputs;
  if (variant.all) outputs = outputs | kOrderedOutputs;
  if (outputs.has(Output::final)) outputs = outputs | OutputSet{Output::alpha};
  fitImage(camera);
  Frame frame(camera.size.x, camera.size.y, outputs);
  if (variant.all || outputs.hasAny({Output::final, Output::alpha}) || !outputs.hasAny(kSolidOutputs)) {
    drawOutputs(camera, settings, variant);
    readBlended(variant, frame);
  }
  const auto draw_solid = [&](Output output, auto& plane) {
    if constexpr (std::is_same_v<decltype(plane), std::vector<glm::vec3>&>) {
      if (!kSolidOutputs.has(output) || !outputs.has(output)) return;
      variant = variantFor(output);
      variant.shown.reset();
      drawOutputs(camera, settings, variant);
      const std::vector<glm::vec4> pixels = readPixels(image_->base_transmittance);
      plane.assign(pixels.begin(), pixels.end());
    }
  };
  forEachPlane(draw_solid, frame);
  return frame;
}

// Pictures that the device cannot bind, hold or sort at once, from the top down. Counts are those of the last band,
// times of all.
Frame GpuRenderer::renderBands(const Camera& camera, const RenderSettings& settings, int rows) {
  Frame frame;
  std::vector<PassTime> times;
  const std::size_t pixels = std::size_t{static_cast<std::uint32_t>(camera.size.x)} * camera.size.y;
  for (int top = 0; top < camera.size.y; top += rows) {
    Camera band = camera;
    band.size.y = std::min(rows, camera.size.y - top);
    band.center.y -= top;
    const Frame part = render(band, settings);
    addTimes(times, times_);
    forEachPlane(
        [&](Output, const auto& from, auto& to) {
          if (!from.empty()) to.reserve(pixels);
          to.insert(to.end(), from.begin(), from.end());
        },
        part, frame);
  }
  times_ = std::move(times);
  frame.width = camera.size.x;
  frame.height = camera.size.y;
  return frame;
}

int GpuRenderer::rowsAtOnce(const Camera& camera) const {
  return static_cast<int>(tg::rowsAtOnce(device_->limits(), static_cast<std::uint32_t>(camera.size.x),
                                         static_cast<std::uint32_t>(camera.size.y)));
}

bool GpuRenderer::draw(const FrameRequest& request) {
  run(prepareFrame(request));
  return finishFrame();
}

void GpuRenderer::run(const Recording& recording) {
  try {
    device_->run(recording.program, recording.view);
  } catch (...) {  // it counts on a recording that was not executed
    program_.reset();
    throw;
  }
}

bool canBeCut(int rows) { return rows > static_cast<int>(kTileSize); }

int halfOfRows(int rows) {
  constexpr int kTile = kTileSize;
  return (rows / 2 + kTile - 1) / kTile * kTile;
}

void drawWhole(const std::function<bool()>& draw) {
  constexpr int kMaxGrowth = 8;
  for (int attempt = 0; attempt < kMaxGrowth; ++attempt) {
    if (draw()) return;
  }
  throw Error(ErrorKind::device, "a frame does not fit the device's buffers however often they grow");
}

GpuRenderer::Recording GpuRenderer::prepareFrame(const FrameRequest& request) {
  checkFrame(request.camera, request.settings);
  return prepare(request.camera, request.settings, variantFor(request.output), request.beside);
}

bool GpuRenderer::sharesProgram(const FrameRequest& request) const {
  const auto side = [](int pixels) { return static_cast<std::uint32_t>(pixels); };
  return program_ && image_->width == side(request.camera.size.x) && image_->height == side(request.camera.size.y) &&
         variantOf(request.settings, variantFor(request.output)) == variant_;
}

bool GpuRenderer::frameFits() const {
  TG_ASSERT(program_ && pairs_, "a frame is under way");
  const Counters counters = program_->counters();
  return counters.work[kWorkPairs].total <= pairs_->capacity && roundsFor(counters.longest_list) <= blend_rounds_;
}

bool GpuRenderer::finishFrame() {
  TG_ASSERT(program_ && pairs_, "a frame is under way");
  times_ = program_->times();
  const Counters counters = program_->counters();
  program_->next();
  const std::uint32_t pairs = counters.work[kWorkPairs].total;
  counts_ = {counters.work[kWorkVisible].total, pairs, {counters.output_range.x, counters.output_range.y}};
  if (pairs <= pairs_->capacity) return blendedAll(counters.longest_list);
  const std::uint32_t most = maxPairCapacity(device_->limits(), tuning_);
  if (pairs > most) {
    program_.reset();  // a frame that was recorded behind this one counts for nothing
    throw TooManyPairs(ErrorKind::device, device_->limits().device,
                       needs(pairs) + " (expected at most " + std::to_string(most) + ")");
  }
  growPairs(pairs);
  return false;
}

std::string GpuRenderer::needs(std::uint32_t pairs) const {
  return std::to_string(image_->width) + " x " + std::to_string(image_->height) + " pixels of the view need " +
         (pairs == ~0u ? "over 4294967294" : std::to_string(pairs)) + " pairs of tile and splat";
}

// A quarter more than a frame has, or just as many where memory has no room for that. Where it has not even for those,
// the next frame begins with the room that there was.
void GpuRenderer::growPairs(std::uint32_t pairs) {
  const std::uint64_t wish = std::uint64_t{pairs} + pairs / 4;
  try {
    try {
      makePairs(static_cast<std::uint32_t>(std::min<std::uint64_t>(wish, maxPairCapacity(device_->limits(), tuning_))));
    } catch (const DoesNotFit&) {
      makePairs(pairs);
    }
  } catch (const DoesNotFit& error) {
    throw TooManyPairs(ErrorKind::device, error.what() + ("; " + needs(pairs)));
  }
  pair_room_ = pairs_->capacity;
}

// As many as pair_room_ says, or few, which a frame that has more makes grow or is cut for.
void GpuRenderer::makeFirstPairs() {
  try {
    makePairs(pair_room_);
  } catch (const DoesNotFit&) {
    pair_room_ = std::min(pair_room_, kFirstPairCapacity);
    makePairs(pair_room_);
  }
}

void GpuRenderer::makePairs(std::uint32_t capacity) {
  program_.reset();
  pairs_.reset();  // the old ones make room for the new ones
  pairs_.emplace(*device_, capacity);
}

std::uint32_t GpuRenderer::roundsFor(std::uint32_t longest_list) const {
  return std::max(longest_list, 1u) / listEntriesPerRound(tuning_) + 1;
}

// False: a tile's list went on after the last dispatch of blend. The next frame has enough of them.
bool GpuRenderer::blendedAll(std::uint32_t longest_list) {
  const std::uint32_t rounds = roundsFor(longest_list);
  if (rounds <= blend_rounds_) return true;
  blend_rounds_ = rounds;
  program_.reset();
  return false;
}

void GpuRenderer::checkFrame(const Camera& camera, const RenderSettings& settings) const {
  if (!splats_) throw Error(ErrorKind::usage, "a frame needs a model whose buffers fit: setModel() comes first");
  checkSettings(settings);
  if (camera.size.x <= 0 || camera.size.y <= 0) {
    throw Error(ErrorKind::usage, "camera \"" + camera.name + "\"",
                "the image is empty (" + std::to_string(camera.size.x) + " x " + std::to_string(camera.size.y) + ")");
  }
}

void GpuRenderer::drawOutputs(const Camera& camera, const RenderSettings& settings, const FrameVariant& variant) {
  do {
    run(prepare(camera, settings, variant));
  } while (!finishFrame());
}

void GpuRenderer::fitImage(const Camera& camera) {
  const auto width = static_cast<std::uint32_t>(camera.size.x);
  const auto height = static_cast<std::uint32_t>(camera.size.y);
  if (!image_ || image_->width != width || image_->height != height) {
    program_.reset();
    image_.emplace(*device_, width, height);
  }
}

// With what the settings and the model add to an output's variant.
FrameVariant GpuRenderer::variantOf(const RenderSettings& settings, FrameVariant variant) const {
  if (model_->textured && textureModeOf(*model_, settings) != kModeNone) {
    variant.sample = settings.texture_filter == TextureFilter::footprint ? kSampleFootprint : kSampleBilinear;
    variant.outside = static_cast<std::uint32_t>(settings.outside.value_or(model_->outside));
  }
  variant.per_pixel = settings.order == SplatOrder::perPixel;
  return variant;
}

// Buffers, passes and uniforms of the next frame.
GpuRenderer::Recording GpuRenderer::prepare(const Camera& camera, const RenderSettings& settings, FrameVariant variant,
                                            const OutputRange& beside) {
  fitImage(camera);
  if (!pairs_) makeFirstPairs();
  ViewUniforms view = viewOf(camera, settings, *model_, *image_, beside);
  if (variant.shown == Output::texture) view.exposure = settings.gain;
  variant = variantOf(settings, variant);
  if (variant != variant_) program_.reset();
  variant_ = variant;
  if (!program_) {
    const GpuLimits limits = device_->limits();
    const FrameInputs inputs{tuning_, limits, *model_, *splats_, *pairs_, *image_, scratch_, variant_, blend_rounds_};
    program_ = device_->prepare(buildFrame(inputs, counters_));
  }
  return {*program_, view};
}

std::vector<glm::vec4> GpuRenderer::readPixels(const BufferPtr& buffer) {
  TG_ASSERT(image_, "a frame was drawn");
  std::vector<glm::vec4> pixels(std::size_t{image_->width} * image_->height);
  device_->download(buffer, std::as_writable_bytes(std::span(pixels)));
  return pixels;
}

// Into the members that the frame holds.
void GpuRenderer::readBlended(const FrameVariant& variant, Frame& frame) {
  const auto put = [](auto& out, std::size_t i, auto value) {
    if (!out.empty()) out[i] = value;
  };
  std::vector<glm::vec4> pixels = readPixels(image_->base_transmittance);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    put(frame.picture, i, glm::vec3(pixels[i]));
    put(frame.base, i, glm::vec3(pixels[i]));
    put(frame.alpha, i, 1.0f - pixels[i].w);
  }
  if (!variant.all) return;
  pixels = readPixels(image_->texture_depth);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    frame.texture[i] = glm::vec3(pixels[i]);
    frame.depth[i] = pixels[i].w;
  }
  pixels = readPixels(image_->normal_count);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    frame.normal[i] = glm::vec3(pixels[i]);
    frame.count[i] = pixels[i].w;
  }
  pixels = readPixels(image_->extras);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    frame.depth_median[i] = pixels[i].x;
    put(frame.overdraw, i, pixels[i].y);
    frame.texel_density[i] = pixels[i].z;
  }
}

}  // namespace tg

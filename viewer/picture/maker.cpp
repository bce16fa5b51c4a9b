// SPDX-License-Identifier: Apache-2.0
// Renderers per model, and the images that leave for the window.
#include "viewer/picture/maker.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <limits>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "render/visualize.h"
#include "shared/limits.h"
#include "viewer/picture/photographs.h"
#include "viewer/view/legend.h"

namespace tg {
namespace {

constexpr std::size_t kModelsAtOnce = 2;  // on the device: the one shown, and one to compare with or to go back to

std::optional<ValueScale> scaleOf(Output output, const OutputRange& range) {
  if (!kNumberOutputs.has(output)) return std::nullopt;
  if (range.most == 0) return ownScale(output, 0, 0);
  return ownScale(output, std::bit_cast<float>(range.least), std::bit_cast<float>(range.most));
}

OutputRange united(const OutputRange& a, const OutputRange& b) {
  return {std::min(a.least, b.least), std::max(a.most, b.most)};
}

FrameRequest frameOf(const PictureRequest& request) { return {request.camera, request.settings, request.output}; }

// Of the model to compare with.
PictureRequest otherOf(PictureRequest request) {
  request.model = request.other->model;
  request.settings.crop = request.other->crop;
  return request;
}

}  // namespace

struct PictureMaker::Loaded {
  struct Parts {
    glm::ivec2 size{0};    // [px] of the whole picture
    int rows = 0;          // at once, with which the next one begins
    int fitted = 0;        // with which the last one was drawn
    bool refused = false;  // more of them have been, of the one at hand
  };

  std::shared_ptr<const GaussianModel> model;
  std::unique_ptr<Renderer> renderer;
  GpuRenderer* gpu = nullptr;  // the same, where it is one
  std::array<Parts, 2> parts;  // the last one used first: a window's picture, and the smaller one while it moves

  // The CPU renderer draws from the model itself, a device has a copy.
  bool isOnlyHere() const { return model.use_count() == (gpu ? 1 : 2); }

  Parts& partsOf(glm::ivec2 size) {
    auto found = std::find_if(parts.begin(), parts.end() - 1, [&](const Parts& p) { return p.size == size; });
    if (found->size != size) *found = {size, size.y};
    std::rotate(parts.begin(), found, found + 1);
    return parts.front();
  }
  // So many rows at once do not fit: what comes next is half of them.
  void refuse(glm::ivec2 size, int tried) {
    Parts& of_size = partsOf(size);
    of_size.rows = halfOfRows(tried);
    of_size.refused = true;
  }
};

PictureMaker::PictureMaker(PictureDevice& device, std::string backend)
    : device_(device), backend_(std::move(backend)) {}
PictureMaker::~PictureMaker() { device_.drain(); }

PictureMaker::Loaded& PictureMaker::loaded(const std::shared_ptr<const GaussianModel>& model) {
  const auto found = std::find_if(loaded_.begin(), loaded_.end(), [&](const Loaded& l) { return l.model == model; });
  if (found != loaded_.end()) {
    loaded_.splice(loaded_.begin(), loaded_, found);
    return loaded_.front();
  }
  while (loaded_.size() >= kModelsAtOnce) loaded_.pop_back();
  Loaded fresh;
  fresh.model = model;
  if (backend_ == "cpu") {
    fresh.renderer = makeCpuRenderer();
  } else {
    std::unique_ptr<GpuRenderer> gpu = device_.makeRenderer();
    gpu->setPrecision(ModelPrecision::compact);
    fresh.gpu = gpu.get();
    fresh.renderer = std::move(gpu);
  }
  fresh.renderer->setModel(model);
  return loaded_.emplace_front(std::move(fresh));
}

std::shared_ptr<PictureImage> PictureMaker::freeImage(glm::ivec2 size) {
  const auto unused = [](const std::shared_ptr<PictureImage>& image) { return image.use_count() == 1; };
  std::erase_if(images_, [&](const auto& image) { return unused(image) && image->size != size; });
  const auto found = std::find_if(images_.begin(), images_.end(),
                                  [&](const auto& image) { return unused(image) && image->size == size; });
  // The window's last use of the image came before it let go of it.
  std::atomic_thread_fence(std::memory_order_acquire);
  return found != images_.end() ? *found : images_.emplace_back(device_.makeImage(size));
}

void PictureMaker::tidy() {
  std::erase_if(loaded_, [](const Loaded& l) { return l.isOnlyHere(); });
  if (loaded_.empty()) std::erase_if(images_, [](const auto& image) { return image.use_count() == 1; });
}

// Of tens of megapixels it takes as much as a model.
void PictureMaker::forgetPhotograph() {
  photograph_path_.clear();
  photograph_.reset();
}

bool PictureMaker::begin(const PictureRequest& request) {
  TG_ASSERT(request.model != nullptr, "a picture is of a model");
  tidy();  // models that are no longer open make room first
  if (!request.other || request.other->photograph != photograph_path_) forgetPhotograph();
  Begun begun{{}, nullptr, nullptr, Clock::now()};
  begun.picture.request = request;
  const bool beside = !request.other && backend_ != "cpu" && !mapsOnHost(request.output, request.settings);
  if (!begun_.empty()) {
    const auto known = [&](const Loaded& l) { return l.model == request.model; };
    if (!beside || !begun_.back().model || std::none_of(loaded_.begin(), loaded_.end(), known)) return false;
  }
  if (beside) {
    Loaded& model = loaded(request.model);
    const std::shared_ptr<PictureImage> image = freeImage(request.camera.size);
    if (model.partsOf(image->size).rows >= image->size.y && beginOnDevice(model, request, image)) {
      begun.model = &model;
      begun.target = image;
      begun.picture.image = image;
      begun_.push_back(std::move(begun));
      return true;
    }
    if (!begun_.empty()) return false;
  }
  draw(begun.picture);
  begun_.push_back(std::move(begun));
  return true;
}

// As the device says it; a picture that it can draw in parts alone is not begun.
bool PictureMaker::beginOnDevice(Loaded& model, const PictureRequest& request,
                                 const std::shared_ptr<PictureImage>& target) {
  try {
    return device_.begin(*model.gpu, frameOf(request), target);
  } catch (const DoesNotFit&) {
    if (!canBeCut(target->size.y)) throw;
    model.refuse(target->size, target->size.y);
    return false;
  }
}

double PictureMaker::expectedRest() const {
  if (begun_.empty()) return 0;
  if (!last_ms_ || !begun_.front().model) return std::numeric_limits<double>::infinity();
  const Clock::time_point start = std::max(begun_.front().start, device_free_);
  return *last_ms_ * static_cast<double>(begun_.size()) - milliseconds(Clock::now() - start);
}

std::optional<Picture> PictureMaker::finish(double milliseconds_at_most) {
  TG_ASSERT(!begun_.empty(), "a picture was begun");
  Begun& oldest = begun_.front();
  if (oldest.model) {
    const std::optional<bool> whole = finishOldest(milliseconds_at_most);
    if (!whole) return std::nullopt;
    if (!*whole) {
      // Those begun after it wait for their turn in the same way: a frame that overflows leaves none under way.
      oldest.start = Clock::now();
      oldest.picture.scale =
          scaleOf(oldest.picture.request.output, drawOnDevice(*oldest.model, oldest.picture.request, *oldest.target));
    } else {
      oldest.picture.scale = scaleOf(oldest.picture.request.output, oldest.model->gpu->counts().range);
    }
    describe(oldest.picture, *oldest.model);
  }
  Picture picture = std::move(oldest.picture);
  const Clock::time_point now = Clock::now();
  picture.milliseconds = milliseconds(now - std::max(oldest.start, device_free_));
  last_ms_ = oldest.model ? std::optional(picture.milliseconds) : std::nullopt;
  device_free_ = now;
  begun_.pop_front();
  return picture;
}

// As the device says it; a picture that it can draw in parts alone is not whole.
std::optional<bool> PictureMaker::finishOldest(double milliseconds_at_most) {
  try {
    return device_.finish(milliseconds_at_most);
  } catch (const DoesNotFit&) {
    const Begun& oldest = begun_.front();
    const glm::ivec2 size = oldest.target->size;
    if (!canBeCut(size.y)) throw;
    oldest.model->refuse(size, size.y);
    return false;
  }
}

void PictureMaker::describe(Picture& picture, const Loaded& model) const {
  picture.passes = model.renderer->passTimes();
  picture.device = model.renderer->deviceName();
  picture.backend = backend_;
}

// Whole, with nothing under way.
void PictureMaker::draw(Picture& picture) {
  const PictureRequest& request = picture.request;
  const auto pair = request.other ? std::make_shared<PicturePair>() : nullptr;
  if (pair && request.other->model && kNumberOutputs.has(request.output)) {
    drawBoth(request, picture, *pair);
    picture.pair = pair;
    return;
  }
  Loaded& model = loaded(request.model);
  const std::shared_ptr<PictureImage> image = freeImage(request.camera.size);
  picture.scale = drawModel(model, request, *image, pair ? &pair->first : nullptr);
  picture.image = image;
  describe(picture, model);
  if (pair) {
    drawOther(request, picture, *pair);
    if (picture.other) picture.pair = pair;
  }
}

// Two models' numbers, in colours of one scale.
void PictureMaker::drawBoth(const PictureRequest& request, Picture& picture, PicturePair& pair) {
  Loaded& first = loaded(request.model);
  Loaded& other = loaded(request.other->model);  // both stay: as many are there at once
  const PictureRequest others = otherOf(request);
  const std::shared_ptr<PictureImage> image = freeImage(request.camera.size), beside = freeImage(request.camera.size);
  if (first.gpu && !mapsOnHost(request.output, request.settings)) {
    const OutputRange own = drawOnDevice(first, request, *image);
    const int fitted = first.partsOf(image->size).fitted;
    const OutputRange both = united(own, drawOnDevice(other, others, *beside, own));
    if (both.least != own.least || both.most != own.most) (void)drawParts(first, request, *image, both, fitted);
    picture.scale = scaleOf(request.output, both);
    pair.first = device_.download(*image);
    pair.other = device_.download(*beside);
  } else {
    RenderSettings settings = request.settings;
    settings.outputs = {request.output};
    const Frame frame = first.renderer->render(request.camera, settings);
    RenderSettings of_other = others.settings;
    of_other.outputs = settings.outputs;
    ValueScale scale;
    auto [left, right] =
        visualizeBoth(frame, other.renderer->render(request.camera, of_other), request.output, settings, scale);
    device_.upload(left, *image);
    device_.upload(right, *beside);
    picture.scale = scale;
    pair.first = std::move(left);
    pair.other = std::move(right);
  }
  picture.image = image;
  picture.other = beside;
  describe(picture, first);
  drawError(request, picture, pair);
}

void PictureMaker::drawOther(const PictureRequest& request, Picture& picture, PicturePair& pair) {
  const OtherPicture& other = *request.other;
  const glm::ivec2 size = request.camera.size;
  const std::shared_ptr<PictureImage> image = freeImage(size);
  if (other.model) {
    (void)drawModel(loaded(other.model), otherOf(request), *image, &pair.other);
  } else {
    if (!photograph_) {
      try {
        photograph_ = std::make_shared<const Image>(readForComparison(other.photograph));
      } catch (const Error& error) {
        picture.problem = error.what();
        return;
      }
      photograph_path_ = other.photograph;
    }
    ResampledPhotograph seen = resampled(*photograph_, other.taken, request.camera, request.settings.background);
    pair.other = exposedLike(std::move(seen.image), request.output, request.settings);
    pair.mask = std::move(seen.mask);
    picture.photograph = photograph_;
    device_.upload(pair.other, *image);
  }
  picture.other = image;
  drawError(request, picture, pair);
}

void PictureMaker::drawError(const PictureRequest& request, Picture& picture, const PicturePair& pair) {
  const Comparison& how = request.other->how;
  if (!hasLegend(how.mode)) return;
  const std::shared_ptr<PictureImage> error = freeImage(request.camera.size);
  device_.upload(composed(pair.first, pair.other, pair.mask, how), *error);
  picture.error = error;
}

std::optional<ValueScale> PictureMaker::drawModel(Loaded& loaded, const PictureRequest& request, PictureImage& target,
                                                  Image* pixels) {
  if (loaded.gpu && !mapsOnHost(request.output, request.settings)) {
    const OutputRange range = drawOnDevice(loaded, request, target);
    if (pixels) *pixels = device_.download(target);
    return scaleOf(request.output, range);
  }
  RenderSettings settings = request.settings;
  settings.outputs = {request.output};
  ValueScale scale;
  Image picture = visualize(loaded.renderer->render(request.camera, settings), request.output, settings, &scale);
  device_.upload(picture, target);
  if (pixels) *pixels = std::move(picture);
  return kNumberOutputs.has(request.output) ? std::optional(scale) : std::nullopt;
}

// Returns the range of the whole picture's numbers. Its colours span those of `beside`, too. Begins with as many rows
// as fitted last, or with twice as many where that was the first try.
OutputRange PictureMaker::drawOnDevice(Loaded& loaded, const PictureRequest& request, PictureImage& target,
                                       const OutputRange& beside) {
  const glm::ivec2 size = request.camera.size;
  const int most = std::min(loaded.gpu->rowsAtOnce(request.camera), size.y);
  Loaded::Parts& parts = loaded.partsOf(size);
  for (;;) {
    const int rows = std::min(parts.rows, most);
    try {
      const OutputRange range = drawParts(loaded, request, target, beside, rows);
      parts.fitted = rows;
      parts.rows = std::exchange(parts.refused, false) ? rows : std::min(2 * rows, most);
      return range;
    } catch (const DoesNotFit&) {
      if (!canBeCut(rows)) throw;
      loaded.refuse(size, rows);
    }
  }
}

// At most so many rows at once.
OutputRange PictureMaker::drawParts(Loaded& loaded, const PictureRequest& request, PictureImage& target,
                                    const OutputRange& beside, int most) {
  FrameRequest frame = frameOf(request);
  frame.beside = beside;
  const auto drawPart = [&](int top) { drawWhole([&] { return device_.draw(*loaded.gpu, frame, target, top); }); };
  const int height = request.camera.size.y;
  if (most >= height) {
    drawPart(0);
    return loaded.gpu->counts().range;
  }
  // Parts of one height, for which the buffers stay: the last one begins before the end of the one before it.
  const int parts = (height + most - 1) / most;
  frame.camera.size.y = (height + parts - 1) / parts;
  const auto drawAll = [&] {
    OutputRange range = frame.beside;
    for (int part = 0; part < parts; ++part) {
      const int top = std::min(part * frame.camera.size.y, height - frame.camera.size.y);
      frame.camera.center.y = request.camera.center.y - top;
      drawPart(top);
      const OutputRange seen = loaded.gpu->counts().range;
      range = united(range, seen);
    }
    return range;
  };
  frame.beside = drawAll();
  if (frame.beside.most > 0) drawAll();  // scaled by the range of all parts, which is only now known
  return frame.beside;
}

}  // namespace tg

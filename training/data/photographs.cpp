// SPDX-License-Identifier: Apache-2.0
// Files to 8-bit pixels, and the store with its read-ahead thread.
#include "training/data/photographs.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <future>
#include <limits>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

std::uint8_t quantize(float value) { return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f); }

std::string sizeText(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

// Whether the mask shows the same picture, at the same size or larger: the shorter side, which says less exactly how
// much larger, may be off by one pixel of the image.
bool maskFits(const Image& mask, int width, int height) {
  if (mask.width < width || mask.height < height) return false;
  const bool wide = width >= height;
  const double scale = wide ? double(mask.width) / width : double(mask.height) / height;
  return std::abs(wide ? mask.height - scale * height : mask.width - scale * width) <= scale;
}

// First and last + 1 of the mask's pixels that a box of the image's covers along one side.
std::pair<int, int> footprint(int box, int downscale, int mask_side, int side) {
  const std::int64_t first = std::int64_t{box} * downscale * mask_side / side;
  const std::int64_t last = (std::int64_t{box + 1} * downscale * mask_side + side - 1) / side;
  return {static_cast<int>(first), static_cast<int>(std::min<std::int64_t>(last, mask_side))};
}

// Whether a mask's pixel lets that of the photograph count.
bool counts(const Image& mask, int x, int y) {
  for (int c = 0; c < std::min(mask.channels, 3); ++c) {
    if (mask.at(x, y, c) > 0) return true;
  }
  return false;
}

// Of a picture of width x height, whose mask is the image. Zero is masked, as COLMAP and nerfstudio have it: a mask of
// 0 and 1 works as well as one of 0 and 255.
std::vector<std::uint8_t> maskOf(const Image& image, int width, int height, int downscale) {
  const int columns = width / downscale;
  const int rows = height / downscale;
  std::vector<std::uint8_t> mask(static_cast<std::size_t>(columns) * rows, 255);
  for (int y = 0; y < rows; ++y) {
    const auto [top, bottom] = footprint(y, downscale, image.height, height);
    for (int x = 0; x < columns; ++x) {
      const auto [left, right] = footprint(x, downscale, image.width, width);
      bool all = true;
      for (int v = top; all && v < bottom; ++v) {
        for (int u = left; all && u < right; ++u) all = counts(image, u, v);
      }
      if (!all) mask[static_cast<std::size_t>(y) * columns + x] = 0;
    }
  }
  return mask;
}

std::vector<std::uint8_t> readMask(const std::filesystem::path& file, int width, int height, int downscale) {
  const Image image = readImage(file);
  if (!maskFits(image, width, height)) {
    throw Error(ErrorKind::badData, file.string(),
                "mask and image differ in size (expected " + sizeText(width, height) + " or an enlargement, found " +
                    sizeText(image.width, image.height) + ")");
  }
  return maskOf(image, width, height, downscale);
}

// A pixel counts where its whole box does. Borders that do not fill a box are cut.
std::vector<std::uint8_t> reduceMask(const std::vector<std::uint8_t>& mask, int width, int height, int downscale) {
  const int columns = width / downscale;
  const int rows = height / downscale;
  std::vector<std::uint8_t> reduced(static_cast<std::size_t>(columns) * rows, 255);
  for (int y = 0; y < rows * downscale; ++y) {
    for (int x = 0; x < columns * downscale; ++x) {
      if (mask[static_cast<std::size_t>(y) * width + x] != 0) continue;
      reduced[static_cast<std::size_t>(y / downscale) * columns + x / downscale] = 0;
    }
  }
  return reduced;
}

float over(float color, float alpha, float background) { return color * alpha + background * (1.0f - alpha); }

// The picture, transparent where its mask is 0.
Image cutOut(const Image& image, const std::vector<std::uint8_t>& mask) {
  Image result(image.width, image.height, 4);
  const std::size_t channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    const float* from = image.data.data() + i * channels;
    float* to = result.data.data() + i * 4;
    for (std::size_t c = 0; c < 3; ++c) to[c] = from[channels == 1 ? 0 : c];
    to[3] = mask[i] == 0 ? 0.0f : channels == 4 ? from[3] : 1.0f;
  }
  return result;
}

// A mask that shows less than this part of a photograph may show none of it once it is reduced or moved by a lens.
constexpr std::size_t kSliver = 16;

bool hidesAll(const std::vector<std::uint8_t>& mask) {
  return !mask.empty() && std::ranges::find(mask, 255) == mask.end();
}

// With its mask, whatever that hides.
Photograph decode(const PhotographSource& source) {
  Image image = readImage(source.image);
  // Of an EXR, before anything mixes pixels: one that is no number would spread.
  for (float& value : image.data) value = value > 0.0f ? std::min(value, 1.0f) : 0.0f;
  const glm::ivec2 file_size(image.width, image.height);
  std::vector<std::uint8_t> mask;
  const bool hides = !source.mask.empty() && source.mask_meaning == MaskMeaning::hidden;
  if (!source.mask.empty() && !hides) image = cutOut(image, readMask(source.mask, image.width, image.height, 1));
  if (source.undistortion) {
    const Undistortion undistortion = source.undistortion(image.width, image.height);
    if (hides) mask = readMask(source.mask, image.width, image.height, 1);
    Undistortion::Result result = undistortion.apply(image, mask);
    image = std::move(result.image);
    mask = std::move(result.mask);
  }
  if (image.width < source.downscale || image.height < source.downscale) {
    throw Error(ErrorKind::usage, source.image.string(),
                "too small for the downscale factor (expected at least " + std::to_string(source.downscale) +
                    " pixels a side, found " + sizeText(image.width, image.height) + ")");
  }
  if (source.undistortion) {
    mask = reduceMask(mask, image.width, image.height, source.downscale);
  } else if (hides) {
    mask = readMask(source.mask, image.width, image.height, source.downscale);
  }
  if (source.downscale > 1) image = downsample(image, source.downscale);

  Photograph photograph = photographOf(image, std::move(mask), source.background);
  photograph.file_width = file_size.x;
  photograph.file_height = file_size.y;
  return photograph;
}

}  // namespace

Image ViewPixels::image() const {
  TG_ASSERT(rgb.size() == 3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
            "three bytes a pixel");
  Image result(width, height, 3);
  for (std::size_t i = 0; i < rgb.size(); ++i) result.data[i] = static_cast<float>(rgb[i]) / 255.0f;
  return result;
}

bool hidesAll(const PhotographSource& source) {
  const Image mask = readImage(source.mask);
  const int downscale = source.undistortion ? 1 : source.downscale;
  if (mask.width < downscale || mask.height < downscale) return false;
  const std::vector<std::uint8_t> own = maskOf(mask, mask.width, mask.height, downscale);
  const std::size_t shown = static_cast<std::size_t>(std::ranges::count(own, 255));
  if (shown == 0 || shown > own.size() / kSliver) return shown == 0;
  return hidesAll(decode(source).pixels.mask);
}

Photograph photographOf(const Image& image, std::vector<std::uint8_t> mask,
                        const std::optional<glm::vec3>& background) {
  Photograph photograph;
  ViewPixels& pixels = photograph.pixels;
  pixels.width = image.width;
  pixels.height = image.height;
  pixels.mask = std::move(mask);
  const std::size_t count = static_cast<std::size_t>(image.width) * image.height;
  const std::size_t channels = static_cast<std::size_t>(image.channels);
  pixels.rgb.resize(count * 3);
  const bool transparent = channels == 4;
  if (transparent && !background) photograph.alpha.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float* from = image.data.data() + i * channels;
    const float alpha = transparent ? from[3] : 1.0f;
    for (int c = 0; c < 3; ++c) {
      const float color = from[channels == 1 ? 0 : c];
      pixels.rgb[i * 3 + c] = quantize(transparent && background ? over(color, alpha, (*background)[c]) : color);
    }
    if (!photograph.alpha.empty()) photograph.alpha[i] = quantize(alpha);
  }
  return photograph;
}

Photograph decodePhotograph(const PhotographSource& source) {
  Photograph photograph = decode(source);
  std::vector<std::uint8_t>& mask = photograph.pixels.mask;
  const bool hides = !source.mask.empty() && source.mask_meaning == MaskMeaning::hidden;
  if (hidesAll(mask)) {
    if (!hides) {
      throw Error(ErrorKind::badData, source.image.string(),
                  "the lens distortion is implausible (expected that undistorting keeps some pixels, found none)");
    }
    throw Error(ErrorKind::badData, source.mask.string(), "the mask hides every pixel (0 hides)");
  }
  const bool all = std::ranges::find(mask, 0) == mask.end();
  if (all && !hides) mask = {};
  return photograph;
}

std::shared_ptr<const ViewPixels> compositeOver(const std::shared_ptr<const Photograph>& photograph,
                                                const glm::vec3& background) {
  TG_ASSERT(photograph, "there is a photograph");
  TG_ASSERT(photograph->alpha.empty() || 3 * photograph->alpha.size() == photograph->pixels.rgb.size(),
            "an alpha a pixel, or none");
  if (photograph->alpha.empty()) return {photograph, &photograph->pixels};
  auto result = std::make_shared<ViewPixels>(photograph->pixels);
  for (std::size_t i = 0; i < photograph->alpha.size(); ++i) {
    const float alpha = static_cast<float>(photograph->alpha[i]) / 255.0f;
    for (int c = 0; c < 3; ++c) {
      std::uint8_t& value = result->rgb[i * 3 + c];
      value = quantize(over(static_cast<float>(value) / 255.0f, alpha, background[c]));
    }
  }
  return result;
}

PhotographStore::PhotographStore(std::size_t views, std::uint64_t limit_bytes, Decode decode)
    : limit_(limit_bytes), decode_(std::move(decode)), kept_(views) {}

void PhotographStore::offer(std::size_t view, Photograph photograph) {
  TG_ASSERT(view < kept_.size(), "the store has this view");
  const std::uint64_t bytes = photograph.bytes();
  const std::lock_guard lock(mutex_);
  largest_ = std::max(largest_, bytes);
  if (bytes > limit_ - kept_bytes_) {
    refused_ = true;
    return;
  }
  kept_[view] = std::make_shared<const Photograph>(std::move(photograph));
  kept_bytes_ += bytes;
}

void PhotographStore::finishOffers() {
  const std::lock_guard lock(mutex_);
  if (!refused_) return;
  const std::uint64_t in_flight = (kReadAhead + 1) * largest_;
  for (std::size_t view = kept_.size(); view-- > 0 && kept_bytes_ + in_flight > limit_;) {
    if (!kept_[view]) continue;
    kept_bytes_ -= kept_[view]->bytes();
    kept_[view].reset();
  }
}

// Decoded by the thread, or by get() where that is first.
struct PhotographStore::Ahead {
  Ahead(std::size_t v, const Decode& file)
      : view(v), decode([&file, v] { return std::make_shared<const Photograph>(file(v)); }) {}

  const std::size_t view;
  std::packaged_task<std::shared_ptr<const Photograph>()> decode;
  std::future<std::shared_ptr<const Photograph>> photograph = decode.get_future();
  std::atomic_flag begun;

  void run() {
    if (!begun.test_and_set()) decode();
  }
  bool ready() const { return photograph.wait_for(std::chrono::seconds(0)) == std::future_status::ready; }
};

std::shared_ptr<PhotographStore::Ahead> PhotographStore::takeAhead(std::size_t view) {
  const auto found = std::ranges::find(ahead_, view, &Ahead::view);
  if (found == ahead_.end()) return nullptr;
  const std::shared_ptr<Ahead> taken = *found;
  ahead_.erase(found);
  return taken;
}

std::shared_ptr<const Photograph> PhotographStore::get(std::size_t view) {
  TG_ASSERT(view < kept_.size(), "the store has this view");
  std::shared_ptr<Ahead> ahead;
  {
    const std::lock_guard lock(mutex_);
    if (kept_.at(view)) return kept_[view];
    ahead = takeAhead(view);
  }
  TG_ASSERT(!ahead || !insideParallelFor(), "a prefetched photograph is not awaited inside a parallelFor");
  if (!ahead) return std::make_shared<const Photograph>(decode_(view));
  ahead->run();  // not begun yet: faster done here than waited for
  return ahead->photograph.get();
}

void PhotographStore::prefetch(std::size_t view) {
  TG_ASSERT(view < kept_.size(), "the store has this view");
  const std::lock_guard lock(mutex_);
  if (kept_.at(view) || std::ranges::find(ahead_, view, &Ahead::view) != ahead_.end()) return;
  if (ahead_.size() >= kReadAhead) {
    const auto unused = std::ranges::find_if(ahead_, &Ahead::ready);
    if (unused == ahead_.end()) return;
    ahead_.erase(unused);
  }
  if (!thread_.joinable()) {
    try {
      thread_ = startWorker(queue_, [this](const std::stop_token& stop) {
        while (const auto next = queue_.take(stop)) (*next)->run();
      });
    } catch (const std::system_error&) {
      return;  // no thread to be had: get() decodes
    }
  }
  ahead_.push_back(std::make_shared<Ahead>(view, decode_));
  queue_.give(ahead_.back());
}

std::size_t PhotographStore::keptViews() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(
      std::count_if(kept_.begin(), kept_.end(), [](const auto& p) { return p != nullptr; }));
}

std::uint64_t PhotographStore::keptBytes() const {
  const std::lock_guard lock(mutex_);
  return kept_bytes_;
}

std::shared_ptr<PhotographStore> storeInMemory(std::vector<Photograph> photographs) {
  auto store = std::make_shared<PhotographStore>(
      photographs.size(), std::numeric_limits<std::uint64_t>::max(),
      [](std::size_t) -> Photograph { throw std::logic_error("every photograph is in memory"); });
  for (std::size_t i = 0; i < photographs.size(); ++i) store->offer(i, std::move(photographs[i]));
  return store;
}

std::uint64_t defaultImageMemory() {
  const long pages = ::sysconf(_SC_PHYS_PAGES);
  const long page = ::sysconf(_SC_PAGESIZE);
  constexpr std::uint64_t kUnknown = std::uint64_t{4} << 30;
  return (pages > 0 && page > 0 ? static_cast<std::uint64_t>(pages) * static_cast<std::uint64_t>(page) : kUnknown) / 4;
}

}  // namespace tg

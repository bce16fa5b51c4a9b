// SPDX-License-Identifier: Apache-2.0
// The pixels of a data set: decoded in parallel, kept in memory within a limit, beyond it decoded when asked for.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "core/image/image.h"
#include "core/system/names.h"
#include "core/system/worker.h"
#include "training/data/lens.h"

namespace tg {

// What a view is trained and scored against.
struct ViewPixels {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> rgb;   // [height, width, 3], display-referred, no transparency left
  std::vector<std::uint8_t> mask;  // [height, width], 0: the pixel does not count; empty: all of them count

  Image image() const;  // the colours in [0, 1]
};

// One decoded file. Where the background is not known yet, `pixels.rgb` is straight and `alpha` is kept beside it.
struct Photograph {
  ViewPixels pixels;
  std::vector<std::uint8_t> alpha;  // [height, width]; empty: opaque, or composited already
  int file_width = 0;               // before downscaling
  int file_height = 0;

  std::size_t bytes() const { return pixels.rgb.size() + pixels.mask.size() + alpha.size(); }
};

// What a picture of values in [0, 1] is in 8 bits, composited over `background`; without one alpha is kept. `mask`: as
// that of ViewPixels.
Photograph photographOf(const Image& image, std::vector<std::uint8_t> mask, const std::optional<glm::vec3>& background);

// What a mask's 0 says of a pixel: it does not count; or it is background, which counts (the protocol of DTU).
enum class MaskMeaning { hidden, background };
constexpr auto namesOf(MaskMeaning) { return enumNames("hidden", "background"); }

struct PhotographSource {
  std::filesystem::path image;
  std::filesystem::path mask;           // empty: none
  int downscale = 1;                    // integer box filter; a pixel counts where the mask has no 0 in its box
  std::optional<glm::vec3> background;  // composited over it, in 8 bit; none: alpha is kept
  // What takes the lens out of a file of width x height pixels, before it is downscaled; none: nothing to take out.
  std::function<Undistortion(int width, int height)> undistortion = nullptr;
  MaskMeaning mask_meaning = MaskMeaning::hidden;
};
// Throws Error(cannotRead / badData / usage): a mask of another size or that hides every pixel, an image smaller than
// one box of the filter, and what Undistortion throws. A mask may be larger than the image.
Photograph decodePhotograph(const PhotographSource& source);

// Whether the mask, which there is, hides every pixel of its photograph as that is trained; where the mask is larger
// than its photograph or a lens is taken out, those that show more than a sixteenth before are taken as showing some.
// Throws what decodePhotograph throws otherwise.
bool hidesAll(const PhotographSource& source);

// The pixels over a colour. Opaque ones are returned as they are, without a copy.
std::shared_ptr<const ViewPixels> compositeOver(const std::shared_ptr<const Photograph>& photograph,
                                                const glm::vec3& background);

// Which views are kept changes how long get() takes, never what it returns. Thread-safe; get() of a view that
// was prefetched must not be called inside a parallelFor, since decoding may use one.
class PhotographStore {
 public:
  using Decode = std::function<Photograph(std::size_t view)>;
  static constexpr int kReadAhead = 2;  // views decoded in advance: one is in work while the other waits

  PhotographStore(std::size_t views, std::uint64_t limit_bytes, Decode decode);

  // Keeps the photograph of a view if the limit allows.
  void offer(std::size_t view, Photograph photograph);
  // After the offers: where some were refused, frees room for the photographs in flight (kReadAhead + 1 of the largest
  // size) inside the limit.
  void finishOffers();

  std::shared_ptr<const Photograph> get(std::size_t view);
  // A hint that get(view) follows soon: decodes in a background thread. Hints beyond kReadAhead replace finished ones
  // that nobody asked for, and are dropped where there are none.
  void prefetch(std::size_t view);

  std::size_t keptViews() const;
  std::uint64_t keptBytes() const;

 private:
  struct Ahead;  // a view read ahead
  // With the lock held; null: it is not read ahead.
  std::shared_ptr<Ahead> takeAhead(std::size_t view);

  const std::uint64_t limit_;
  const Decode decode_;
  mutable std::mutex mutex_;  // guards everything below but queue_
  std::vector<std::shared_ptr<const Photograph>> kept_;
  std::uint64_t kept_bytes_ = 0;
  std::uint64_t largest_ = 0;
  bool refused_ = false;
  std::vector<std::shared_ptr<Ahead>> ahead_;  // the oldest first
  Queue<std::shared_ptr<Ahead>> queue_;
  std::jthread thread_;
};

// All photographs in memory, without files.
std::shared_ptr<PhotographStore> storeInMemory(std::vector<Photograph> photographs);

// A quarter of the machine's memory. [bytes]
std::uint64_t defaultImageMemory();

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// The renderer that every API on a GPU shares: keeps the buffers that the next frame needs, lists its passes, reads it
// back. What differs is the GpuDevice that it is given.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/gpu/frame.h"
#include "render/renderer.h"

namespace tg {

// Bits of the smallest and of the largest number above 0 that an output has, where its picture is scaled by them
// (depths, count, overdraw); no numbers otherwise.
struct OutputRange {
  std::uint32_t least = ~0u;
  std::uint32_t most = 0;
};

// A view has more pairs of tile and splat than the device binds, or has memory for.
struct TooManyPairs : DoesNotFit {
  using DoesNotFit::DoesNotFit;
};

// One frame of the live viewer.
struct FrameRequest {
  Camera camera;
  RenderSettings settings;
  Output output = Output::final;  // settings.outputs does not count
  OutputRange beside{};           // of the other parts, where this is a part of a picture
};

// What the device counted in the last finished frame.
struct FrameCounts {
  std::uint32_t visible = 0;  // splats that reach the screen
  std::uint32_t pairs = 0;    // (tile, splat)
  OutputRange range;          // of draw()'s output
};

class GpuRenderer : public Renderer {
 public:
  GpuRenderer(std::unique_ptr<GpuDevice> device, const PassTuning& tuning);

  // From the next model on. exact unless said otherwise.
  void setPrecision(ModelPrecision precision) { precision_ = precision; }
  using Renderer::setModel;
  void setModel(const GaussianModel& model) override;
  Frame render(const Camera& camera, const RenderSettings& settings) override;
  std::vector<PassTime> passTimes() const override { return times_; }
  std::string deviceName() const override { return device_->limits().device; }
  FrameCounts counts() const { return counts_; }

  // How many rows of the camera's image draw() can draw at once. Throws Error(device) when none.
  int rowsAtOnce(const Camera& camera) const;
  // Draws the picture of the requested output and waits for it. False: the pair buffer overflowed, the picture is
  // incomplete and the buffers have been grown for the next frame. Throws TooManyPairs where they cannot grow so far,
  // DoesNotFit where there is no memory for the image; the next frame may be another one.
  bool draw(const FrameRequest& request);
  // What draw() drew, 3 channels.
  Image picture() { return device_->download(image_->picture, image_->width, image_->height); }

 protected:
  GpuDevice& gpu() { return *device_; }
  const GpuImage* image() const { return image_ ? image_->picture.get() : nullptr; }
  struct Recording {
    PassProgram& program;
    ViewUniforms view;
  };
  // What draw() is made of: the first says what to run, the second comes after it has run and returns as draw() does.
  Recording prepareFrame(const FrameRequest& request);
  bool finishFrame();
  // Where frames overlap: whether the next one may be prepared while earlier ones run, and whether finishFrame() will
  // return true for the oldest that has run. When not, no other may still run.
  bool sharesProgram(const FrameRequest& request) const;
  bool frameFits() const;

 private:
  void makeFirstPairs();
  void makePairs(std::uint32_t capacity);
  void growPairs(std::uint32_t pairs);
  std::string needs(std::uint32_t pairs) const;
  std::uint32_t roundsFor(std::uint32_t longest_list) const;
  bool blendedAll(std::uint32_t longest_list);
  FrameVariant variantOf(const RenderSettings& settings, FrameVariant variant) const;
  Frame renderWhole(const Camera& camera, const RenderSettings& settings);
  Frame renderBands(const Camera& camera, const RenderSettings& settings, int rows);
  void checkFrame(const Camera& camera, const RenderSettings& settings) const;
  void run(const Recording& recording);
  void drawOutputs(const Camera& camera, const RenderSettings& settings, const FrameVariant& variant);
  void fitImage(const Camera& camera);
  Recording prepare(const Camera& camera, const RenderSettings& settings, FrameVariant variant,
                    const OutputRange& beside = {});
  std::vector<glm::vec4> readPixels(const BufferPtr& buffer);
  void readBlended(const FrameVariant& variant, Frame& frame);

  std::unique_ptr<GpuDevice> device_;
  PassTuning tuning_;
  ModelPrecision precision_ = ModelPrecision::exact;
  Scratch scratch_;
  BufferPtr counters_;
  std::optional<ModelBuffers> model_;
  std::optional<SplatBuffers> splats_;
  std::optional<PairBuffers> pairs_;  // none: where there was no memory for them, until the next frame
  std::uint32_t pair_room_ = 0;       // that they have or will have
  std::optional<ImageBuffers> image_;
  FrameVariant variant_;
  std::uint32_t blend_rounds_ = 1;
  std::unique_ptr<PassProgram> program_;  // of the buffers above, which it outlives in no case
  std::vector<PassTime> times_;
  FrameCounts counts_;
};

// Whether a picture of so many rows can be drawn in parts.
bool canBeCut(int rows);
// Of a picture of so many rows, more than a tile has: how many are in the bands into which it is cut where it
// does not fit, at least those of a row of tiles.
int halfOfRows(int rows);

// Repeats a frame until its buffers are large enough: `draw` is GpuRenderer::draw() or returns as it does. Throws
// Error(device) where they never are.
void drawWhole(const std::function<bool()>& draw);

}  // namespace tg

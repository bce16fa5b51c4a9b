// SPDX-License-Identifier: Apache-2.0
// What the passes need of an API: memory, copies, and the execution of a list of passes. Vulkan and OpenGL each do it.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/system/error.h"
#include "render/renderer.h"
#include "shared/layout.h"
#include "shared/work.h"

namespace tg {

class PassList;

// A buffer on the device. Its size is rounded up by bufferBytes(): an empty model binds like any other, and buffers of
// smaller elements can be read four at a time.
class GpuBuffer {
 public:
  virtual ~GpuBuffer() = default;
};
using BufferPtr = std::unique_ptr<GpuBuffer>;

// An RGBA8 picture on the device.
class GpuImage {
 public:
  virtual ~GpuImage() = default;
};
using ImagePtr = std::unique_ptr<GpuImage>;

// Of a storage buffer: the largest size in multiples of 16 that passes can count.
constexpr std::uint32_t kMostStorageBytes = 0xFFFFFFF0u;
// Of what a driver says that it binds: buffers are whole multiples of 16 bytes.
constexpr std::uint32_t wholeStorageBytes(std::int64_t limit) {
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(limit, 0, kMostStorageBytes)) / 16 * 16;
}

struct GpuLimits {
  std::string device;                // its name, for messages
  std::uint32_t storage_bytes = 0;   // that a storage buffer shows a shader, at most kMostStorageBytes
  std::uint32_t texel_elements = 0;  // of a buffer that is bound as texels
  std::uint32_t image_side = 0;      // [px]
};

// A device as a list of devices shows it.
struct DeviceInfo {
  std::string api;      // "Vulkan", "OpenGL"
  std::string version;  // of the API, as the driver words it
  bool software = false;
  GpuLimits limits;
  std::string missing;  // why it cannot be used; "": it can
};

// A list of passes made ready to run: again and again, each time with another view.
class PassProgram {
 public:
  virtual ~PassProgram() = default;
  // Both of the oldest run that next() has not passed, which has ended. Times are empty on devices that cannot tell.
  virtual Counters counters() const = 0;
  virtual std::vector<PassTime> times() const = 0;
  // That run's results are no longer wanted.
  virtual void next() = 0;
};

// A device has no room for what a picture needs; fewer of its rows need less.
struct DoesNotFit : Error {
  using Error::Error;
};

// Every function throws Error(device) when the device fails, makeBuffer() and makeImage() DoesNotFit when it has no
// memory left.
class GpuDevice {
 public:
  virtual ~GpuDevice() = default;
  virtual GpuLimits limits() const = 0;
  // `name` must live as long as the buffer.
  virtual BufferPtr makeBuffer(const char* name, std::uint64_t bytes) = 0;
  virtual ImagePtr makeImage(std::uint32_t width, std::uint32_t height) = 0;
  // Fills `target` from offset 0: write(first_byte, piece) delivers the next piece, whose length is a multiple of
  // `granularity`.
  virtual void upload(const BufferPtr& target, std::uint64_t bytes, std::uint64_t granularity,
                      const std::function<void(std::uint64_t first, std::span<std::byte>)>& write) = 0;
  // Reads `out.size()` bytes from offset 0.
  virtual void download(const BufferPtr& source, std::span<std::byte> out) = 0;
  // 3 channels.
  virtual Image download(const ImagePtr& source, std::uint32_t width, std::uint32_t height) = 0;
  // The buffers of the list must outlive the program.
  virtual std::unique_ptr<PassProgram> prepare(const PassList& list) = 0;
  // Waits for the end.
  virtual void run(PassProgram& program, const ViewUniforms& view) = 0;
};

// A multiple of 16, 16 at least.
std::uint64_t bufferBytes(std::uint64_t bytes);
// How much to allocate for a buffer of that many bytes, and for an image of that side [px] on a device of at most
// `most`. llvmpipe compiles a shader anew when the size of a texel buffer or of an image that is bound to it becomes or
// ceases to be a power of two, and when bits 8 to 15 of a texel buffer's bytes become or cease to be 0: no allocation
// is like that, so that a window may have any size and a model any length.
std::uint64_t allocatedBytes(std::uint64_t bytes);
std::uint32_t allocatedSide(std::uint32_t side, std::uint32_t most);

// The 3 colour channels.
Image imageFromRgba8(std::span<const std::byte> pixels, int width, int height);
// 3 channels in [0, 1], rounded; opaque. As many pixels as the image has.
void toRgba8(const Image& image, std::span<std::byte> pixels);

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Which codec a file needs, and the arithmetic on images that every room shares.
#include "core/image/image.h"

#include <algorithm>

#include "core/file/file.h"
#include "core/image/codecs.h"
#include "core/image/drawn.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "core/system/parallel.h"
#include "core/system/shortened.h"

namespace tg {
namespace {

constexpr std::uint64_t kMaxImageFileBytes = std::uint64_t{4} << 30;
// Images below this never need the ratio test: they cannot exhaust a machine.
constexpr std::int64_t kAlwaysAllowedBytes = std::int64_t{64} << 20;

bool startsWith(std::span<const std::uint8_t> bytes, std::initializer_list<std::uint8_t> magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

void checkWritable(const Image& image, const std::string& path) {
  const std::int64_t pixels = std::int64_t{image.width} * image.height;
  const bool size_ok = image.width > 0 && image.height > 0 && pixels <= kMaxImagePixels;
  if (!size_ok || (image.channels != 1 && image.channels != 3 && image.channels != 4) ||
      image.data.size() != static_cast<std::size_t>(pixels * image.channels)) {
    throw Error(ErrorKind::cannotWrite, path,
                "image cannot be stored (expected 1, 3 or 4 channels and some pixels, found " +
                    std::to_string(image.width) + " x " + std::to_string(image.height) + " x " +
                    std::to_string(image.channels) + ")");
  }
}

}  // namespace

void checkImageSize(std::int64_t width, std::int64_t height, std::int64_t bytes_per_pixel, std::size_t file_bytes,
                    std::int64_t max_ratio, const std::string& path) {
  const std::string found = std::to_string(width) + " x " + std::to_string(height);
  if (width < 1 || height < 1 || width > kMaxImagePixels || height > kMaxImagePixels ||
      width * height > kMaxImagePixels) {
    throw Error(
        ErrorKind::badData, path,
        "image size out of range (expected 1 to " + std::to_string(kMaxImagePixels) + " pixels, found " + found + ")");
  }
  const std::int64_t raw = width * height * bytes_per_pixel;
  if (raw > kAlwaysAllowedBytes && raw / max_ratio > static_cast<std::int64_t>(file_bytes)) {
    throw Error(ErrorKind::badData, path,
                "file is too short for its image size (found " + std::to_string(file_bytes) + " bytes for " + found +
                    " pixels)");
  }
}

namespace {

constexpr std::size_t kMagicBytes = 12;
using DecodeFile = Image (*)(std::span<const std::uint8_t> bytes, const std::string& path);

// By the first kMagicBytes of a file.
DecodeFile decoderOf(std::span<const std::uint8_t> bytes, const std::string& path) {
  if (startsWith(bytes, {0x89, 'P', 'N', 'G'})) return decodePng;
  if (startsWith(bytes, {0xff, 0xd8, 0xff})) return decodeJpeg;
  if (startsWith(bytes, {0x76, 0x2f, 0x31, 0x01})) return decodeExrPicture;
  const bool riff = startsWith(bytes, {'R', 'I', 'F', 'F'});  // four bytes of length follow
  if (riff && bytes.size() >= kMagicBytes && startsWith(bytes.subspan(8), {'W', 'E', 'B', 'P'})) {
    return decodeWebpPicture;
  }
  throw Error(ErrorKind::badData, path, "unknown image format (expected PNG, JPEG, WebP or EXR)");
}

}  // namespace

Image decodeImage(std::span<const std::uint8_t> bytes, const std::string& path) {
  return decoderOf(bytes, path)(bytes, path);
}

Image readImage(const std::filesystem::path& path) {
  const FileReader file(path, kMaxImageFileBytes);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), kMagicBytes)));
  const std::size_t start = bytes.size();
  file.read(0, bytes);
  const DecodeFile decode = decoderOf(bytes, path.string());  // before the rest is read
  bytes.resize(static_cast<std::size_t>(file.size()));
  file.read(start, std::span(bytes).subspan(start));
  return decode(bytes, path.string());
}

namespace {

void write(const std::filesystem::path& path, const Image& image, bool drawn) {
  checkWritable(image, path.string());
  const std::string extension = lowerExtension(path);
  if (extension == ".png") return writeFileAtomically(path, drawn ? encodeDrawnPng(image) : encodePng(image));
  if (extension == ".jpg" || extension == ".jpeg")
    return writeFileAtomically(path, encodeJpeg(image, 95, drawn, path.string()));
  if (extension == ".exr") return writeFileAtomically(path, encodeExrPicture(image, path.string()));
  throw Error(ErrorKind::usage, path.string(),
              "unknown image format (expected .png, .jpg or .exr, found \"" + shortened(extension, 20, 10) + "\")");
}

}  // namespace

void writeImage(const std::filesystem::path& path, const Image& image) { write(path, image, false); }
void writeDrawn(const std::filesystem::path& path, const Image& image) { write(path, image, true); }

bool isDrawn(std::span<const std::uint8_t> start) {
  return !std::ranges::search(start.first(std::min(start.size(), kDrawnBytes)), kDrawnBy).empty();
}

Image compositeOver(const Image& image, const float background[3]) {
  TG_ASSERT(hasImageShape(image), "the image's data has its size");
  if (image.channels == 3) return image;
  Image result(image.width, image.height, 3);
  const std::size_t pixels = static_cast<std::size_t>(image.width) * image.height;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* from = image.data.data() + i * image.channels;
    const float alpha = image.channels == 4 ? from[3] : 1.0f;
    for (std::size_t c = 0; c < 3; ++c) {
      result.data[i * 3 + c] = from[image.channels == 1 ? 0 : c] * alpha + background[c] * (1.0f - alpha);
    }
  }
  return result;
}

Image downsample(const Image& image, int factor) {
  TG_ASSERT(hasImageShape(image), "the image's data has its size");
  if (factor < 1) {
    throw Error(ErrorKind::usage,
                "reduction factor out of range (expected at least 1, found " + std::to_string(factor) + ")");
  }
  if (factor == 1) return image;
  if (image.width < factor || image.height < factor) {
    throw Error(ErrorKind::badData, "image is smaller than one box of the reduction (expected at least " +
                                        std::to_string(factor) + " a side, found " + std::to_string(image.width) +
                                        " x " + std::to_string(image.height) + ")");
  }
  Image result(image.width / factor, image.height / factor, image.channels);
  parallelFor(result.height, 8, [&](int y) {
    for (int x = 0; x < result.width; ++x) {
      double sum[4] = {};
      double alpha_sum = 0.0;
      for (int v = y * factor; v < (y + 1) * factor; ++v) {
        for (int u = x * factor; u < (x + 1) * factor; ++u) {
          const double alpha = image.channels == 4 ? image.at(u, v, 3) : 1.0;
          alpha_sum += alpha;
          for (int c = 0; c < std::min(image.channels, 3); ++c) sum[c] += alpha * image.at(u, v, c);
        }
      }
      for (int c = 0; c < std::min(image.channels, 3); ++c) {
        result.at(x, y, c) = alpha_sum > 0.0 ? static_cast<float>(sum[c] / alpha_sum) : 0.0f;
      }
      if (image.channels == 4) result.at(x, y, 3) = static_cast<float>(alpha_sum / (double(factor) * factor));
    }
  });
  return result;
}

}  // namespace tg

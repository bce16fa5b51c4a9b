// SPDX-License-Identifier: Apache-2.0
// WebP by libwebp, to and from memory.
#include "core/image/webp.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <memory>
#include <new>
#include <stdexcept>

#include "core/image/codecs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

// [bytes of pixels in a byte of file]. Pictures of one colour reach 95,000: beyond 16 Mi pixels
// they are refused where nobody expects as many.
constexpr std::int64_t kMaxRatio = 4000;
constexpr int kEffort =
    6;  // of 0 to 9: 9 takes 70 times as long for 0.06 % of lego with textures (docs/lab/converter.md)

}  // namespace

WebpHeader readWebpHeader(std::span<const std::uint8_t> bytes, const std::string& path) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK) {
    throw Error(ErrorKind::badData, path, "no WebP file");
  }
  if (features.has_animation) throw Error(ErrorKind::badData, path, "an animated WebP (expected a single picture)");
  constexpr int lossless = 2;  // 0 is unknown or mixed, 1 lossy
  return {features.width, features.height, features.format == lossless, features.has_alpha != 0};
}

BytePixels decodeWebp(std::span<const std::uint8_t> bytes, const std::string& path, std::size_t expected) {
  const WebpHeader header = readWebpHeader(bytes, path);
  const bool is_expected =
      static_cast<std::size_t>(header.width) * static_cast<std::size_t>(header.height) / 2 < expected;
  if (!is_expected) checkImageSize(header.width, header.height, 4, bytes.size(), kMaxRatio, path);
  BytePixels pixels(header.width, header.height);
  if (!WebPDecodeRGBAInto(bytes.data(), bytes.size(), pixels.data.data(), pixels.data.size(), 4 * pixels.width)) {
    throw Error(ErrorKind::badData, path, "broken WebP file");
  }
  return pixels;
}

Image decodeWebpPicture(std::span<const std::uint8_t> bytes, const std::string& path) {
  const bool alpha = readWebpHeader(bytes, path).alpha;
  const BytePixels pixels = decodeWebp(bytes, path);
  Image image(pixels.width, pixels.height, alpha ? 4 : 3);
  const std::size_t channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    for (std::size_t c = 0; c < channels; ++c) {
      image.data[channels * i + c] = static_cast<float>(pixels.data[4 * i + c]) / 255.0f;
    }
  }
  return image;
}

std::vector<std::uint8_t> encodeWebp(const BytePixels& pixels) {
  TG_ASSERT(pixels.width >= 1 && pixels.width <= kMaxWebpSide && pixels.height >= 1 && pixels.height <= kMaxWebpSide,
            "a WebP has sides of 1 to 16383");
  TG_ASSERT(pixels.size() == static_cast<std::size_t>(pixels.width) * static_cast<std::size_t>(pixels.height),
            "the data has its size");
  WebPConfig config;
  WebPPicture picture;
  if (!WebPConfigInit(&config) || !WebPPictureInit(&picture) || !WebPConfigLosslessPreset(&config, kEffort)) {
    throw std::runtime_error("libwebp is of another version than its headers");
  }
  config.exact = 1;
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  const std::unique_ptr<WebPMemoryWriter, void (*)(WebPMemoryWriter*)> written(&writer, WebPMemoryWriterClear);
  const std::unique_ptr<WebPPicture, void (*)(WebPPicture*)> held(&picture, WebPPictureFree);
  picture.use_argb = 1;
  picture.width = pixels.width;
  picture.height = pixels.height;
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  if (!WebPPictureImportRGBA(&picture, pixels.data.data(), 4 * pixels.width) || !WebPEncode(&config, &picture)) {
    throw std::bad_alloc();  // nothing else can go wrong in memory
  }
  return {writer.mem, writer.mem + writer.size};
}

}  // namespace tg

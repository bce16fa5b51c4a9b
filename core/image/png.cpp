// SPDX-License-Identifier: Apache-2.0
// PNG by libpng, to and from memory.
#include <png.h>

#include <algorithm>
#include <csetjmp>
#include <cstdlib>
#include <cstring>
#include <new>
#include <utility>

#include "core/image/codecs.h"
#include "core/image/drawn.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

// libpng reports errors by longjmp, which must not skip destructors: everything it touches lives here, outside the
// function that calls setjmp.
struct PngState {
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::jmp_buf jump;
  char message[256] = {};
  std::span<const std::uint8_t> input;
  std::vector<std::uint8_t> output;
  bool out_of_memory = false;
};

void onError(png_structp png, png_const_charp message) {
  auto* state = static_cast<PngState*>(png_get_error_ptr(png));
  std::strncpy(state->message, message, sizeof(state->message) - 1);
  std::longjmp(state->jump, 1);
}
void onWarning(png_structp, png_const_charp) {}

png_voidp onAllocate(png_structp png, png_alloc_size_t bytes) {
  void* memory = std::malloc(bytes);
  if (!memory) static_cast<PngState*>(png_get_mem_ptr(png))->out_of_memory = true;
  return memory;
}
void onFree(png_structp, png_voidp memory) { std::free(memory); }

void onRead(png_structp png, png_bytep data, std::size_t length) {
  auto* state = static_cast<PngState*>(png_get_io_ptr(png));
  if (state->input.size() < length) png_error(png, "file ends early");
  std::memcpy(data, state->input.data(), length);
  state->input = state->input.subspan(length);
}

void onWrite(png_structp png, png_bytep data, std::size_t length) {
  auto* state = static_cast<PngState*>(png_get_io_ptr(png));
  try {
    state->output.insert(state->output.end(), data, data + length);
  } catch (...) {
    state->out_of_memory = true;
  }
  if (state->out_of_memory) png_error(png, "out of memory");
}
void onFlush(png_structp) {}

struct PngReader : PngState {
  PngReader() {
    auto* state = static_cast<PngState*>(this);
    png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, state, onError, onWarning, state, onAllocate, onFree);
  }
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
};
struct PngWriter : PngState {
  PngWriter() {
    auto* state = static_cast<PngState*>(this);
    png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, state, onError, onWarning, state, onAllocate, onFree);
  }
  ~PngWriter() { png_destroy_write_struct(&png, &info); }
};

struct PngHeader {
  png_uint_32 width, height;
  int bits_per_pixel;
};
struct PngRows {
  int channels, bit_depth;
  std::size_t bytes;  // of one
};

bool readHeader(PngState& state, PngHeader& header) {
  if (setjmp(state.jump)) return false;
  png_set_read_fn(state.png, &state, onRead);
  png_set_user_limits(state.png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // checkImageSize decides
  png_set_crc_action(state.png, PNG_CRC_ERROR_QUIT, PNG_CRC_WARN_DISCARD);
  // Nothing is asked of other chunks than IHDR, PLTE, tRNS, IDAT and IEND; the library would unpack and keep texts and
  // profiles, 8 MB of each.
  png_set_keep_unknown_chunks(state.png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_read_info(state.png, state.info);
  header.width = png_get_image_width(state.png, state.info);
  header.height = png_get_image_height(state.png, state.info);
  header.bits_per_pixel = png_get_bit_depth(state.png, state.info) * png_get_channels(state.png, state.info);
  return true;
}

// Takes memory for several rows.
bool beginRows(PngState& state, PngRows& decoded) {
  if (setjmp(state.jump)) return false;
  png_set_expand(state.png);  // palettes, 1-4 bit grey, tRNS
  if (png_get_color_type(state.png, state.info) == PNG_COLOR_TYPE_GRAY_ALPHA ||
      (png_get_color_type(state.png, state.info) == PNG_COLOR_TYPE_GRAY &&
       png_get_valid(state.png, state.info, PNG_INFO_tRNS))) {
    png_set_gray_to_rgb(state.png);
  }
  png_set_interlace_handling(state.png);
  png_read_update_info(state.png, state.info);
  decoded.channels = png_get_channels(state.png, state.info);
  decoded.bit_depth = png_get_bit_depth(state.png, state.info);
  decoded.bytes = png_get_rowbytes(state.png, state.info);
  return true;
}

bool readRows(PngState& state, std::vector<png_bytep>& rows) {
  if (setjmp(state.jump)) return false;
  png_read_image(state.png, rows.data());
  png_read_end(state.png, nullptr);
  return true;
}

bool writeRows(PngState& state, const Image& image, int bits, bool drawn, std::vector<png_bytep>& rows) {
  if (setjmp(state.jump)) return false;
  const int color = image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                    : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                          : PNG_COLOR_TYPE_RGB_ALPHA;
  png_set_write_fn(state.png, &state, onWrite, onFlush);
  png_set_compression_level(state.png, 6);
  png_set_IHDR(state.png, state.info, static_cast<png_uint_32>(image.width), static_cast<png_uint_32>(image.height),
               bits, color, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  if (drawn) {
    char key[] = "Software";
    char words[kDrawnBy.size() + 1] = {};
    kDrawnBy.copy(words, kDrawnBy.size());
    png_text text{};
    text.compression = PNG_TEXT_COMPRESSION_NONE;
    text.key = key;
    text.text = words;
    png_set_text(state.png, state.info, &text, 1);
  }
  png_write_info(state.png, state.info);
  png_write_image(state.png, rows.data());
  png_write_end(state.png, nullptr);
  return true;
}

void begin(PngState& state) {
  if (state.png) state.info = png_create_info_struct(state.png);
  if (!state.info) throw std::bad_alloc();
}

[[noreturn]] void fail(const PngState& state, ErrorKind kind, const std::string& path, const std::string& what) {
  if (state.out_of_memory) throw std::bad_alloc();
  throw Error(kind, path, what + state.message);
}

}  // namespace

Image decodePng(std::span<const std::uint8_t> bytes, const std::string& path) {
  PngReader state;
  begin(state);
  state.input = bytes;
  PngHeader header{};
  if (!readHeader(state, header)) fail(state, ErrorKind::badData, path, "broken PNG: ");
  // Deflate never exceeds 1032 : 1. A packed pixel may be less than a byte: count it as 8 pixels a byte.
  checkImageSize(header.width, header.height, std::max(1, header.bits_per_pixel / 8), bytes.size(),
                 header.bits_per_pixel < 8 ? 1040 * 8 : 1040, path);
  PngRows decoded{};
  if (!beginRows(state, decoded)) fail(state, ErrorKind::badData, path, "broken PNG: ");
  std::vector<std::uint8_t> pixels(decoded.bytes * header.height);
  std::vector<png_bytep> rows(header.height);
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = pixels.data() + y * decoded.bytes;
  if (!readRows(state, rows)) fail(state, ErrorKind::badData, path, "broken PNG: ");

  Image image(static_cast<int>(header.width), static_cast<int>(header.height), decoded.channels);
  const std::size_t row_values = static_cast<std::size_t>(header.width) * static_cast<std::size_t>(decoded.channels);
  parallelFor(image.height, 64, [&](std::int64_t y) {
    const std::uint8_t* from = rows[static_cast<std::size_t>(y)];
    float* to = image.data.data() + static_cast<std::size_t>(y) * row_values;
    if (decoded.bit_depth == 16) {
      for (std::size_t i = 0; i < row_values; ++i) {
        to[i] = static_cast<float>(from[2 * i] << 8 | from[2 * i + 1]) / 65535.0f;
      }
    } else {
      for (std::size_t i = 0; i < row_values; ++i) to[i] = static_cast<float>(from[i]) / 255.0f;
    }
  });
  return image;
}

namespace {

std::vector<std::uint8_t> encode(const Image& image, int bits, bool drawn) {
  TG_ASSERT(bits == 8 || bits == 16, "8 or 16 bits a channel");
  const std::string name = "PNG";
  if (image.channels != 1 && image.channels != 3 && image.channels != 4) {
    throw Error(ErrorKind::cannotWrite, name,
                "wrong number of channels (expected 1, 3 or 4, found " + std::to_string(image.channels) + ")");
  }
  PngWriter state;
  begin(state);
  const std::size_t sample_bytes = bits == 16 ? 2 : 1;
  std::vector<std::uint8_t> pixels(image.data.size() * sample_bytes);
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    const float v = image.data[i] > 0.0f ? std::min(image.data[i], 1.0f) : 0.0f;  // NaN becomes 0
    if (bits == 16) {
      const auto stored = static_cast<unsigned>(static_cast<double>(v) * 65535.0 + 0.5);
      pixels[2 * i] = static_cast<std::uint8_t>(stored >> 8);  // big endian
      pixels[2 * i + 1] = static_cast<std::uint8_t>(stored);
    } else {
      pixels[i] = static_cast<std::uint8_t>(v * 255.0f + 0.5f);
    }
  }
  std::vector<png_bytep> rows(static_cast<std::size_t>(image.height));
  const std::size_t row_bytes =
      static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.channels) * sample_bytes;
  for (std::size_t y = 0; y < rows.size(); ++y) rows[y] = pixels.data() + y * row_bytes;
  if (!writeRows(state, image, bits, drawn, rows)) fail(state, ErrorKind::cannotWrite, name, "");
  return std::move(state.output);
}

}  // namespace

std::vector<std::uint8_t> encodePng(const Image& image) { return encode(image, 8, false); }
std::vector<std::uint8_t> encodeDrawnPng(const Image& image) { return encode(image, 8, true); }
std::vector<std::uint8_t> encodePng16(const Image& image) { return encode(image, 16, false); }

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// JPEG by libjpeg, to and from memory.
#include <algorithm>
#include <csetjmp>
#include <cstdio>
#include <utility>

#include "core/image/codecs.h"
#include "core/image/drawn.h"
#include "core/system/assert.h"
#include "core/system/error.h"

// After <cstdio>: jpeglib.h uses FILE without including it.
#include <jerror.h>
#include <jpeglib.h>

namespace tg {
namespace {

// A progressive file may list any number of scans over the same pixels; encoders write about ten.
constexpr int kMaxScans = 200;

struct JpegErrors {
  jpeg_error_mgr manager;  // first: libjpeg hands back a pointer to it
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = {};
};

void onError(j_common_ptr info) {
  auto* errors = reinterpret_cast<JpegErrors*>(info->err);
  info->err->format_message(info, errors->message);
  std::longjmp(errors->jump, 1);
}
// libjpeg calls damage a warning and fills the rest with grey. Here damage is an error; only bytes between markers,
// which some cameras leave, pass.
void onMessage(j_common_ptr info, int level) {
  if (level < 0 && info->err->msg_code != JWRN_EXTRANEOUS_DATA) onError(info);
}
void onProgress(j_common_ptr info) {
  if (!info->is_decompressor) return;
  const auto* decoder = reinterpret_cast<j_decompress_ptr>(info);
  if (decoder->input_scan_number <= kMaxScans) return;
  auto* errors = reinterpret_cast<JpegErrors*>(info->err);
  std::snprintf(errors->message, sizeof(errors->message), "more than %d scans", kMaxScans);
  std::longjmp(errors->jump, 1);
}

jpeg_error_mgr* install(JpegErrors& errors) {
  jpeg_error_mgr* manager = jpeg_std_error(&errors.manager);
  manager->error_exit = onError;
  manager->emit_message = onMessage;
  return manager;
}

// As with PNG: nothing with a destructor in the functions that call setjmp.
struct Decoder {
  JpegErrors errors;
  jpeg_decompress_struct info{};
  jpeg_progress_mgr progress{};
  ~Decoder() { jpeg_destroy_decompress(&info); }

  bool readHeader(std::span<const std::uint8_t> bytes) {
    info.err = install(errors);
    if (setjmp(errors.jump)) return false;
    jpeg_create_decompress(&info);
    progress.progress_monitor = onProgress;
    info.progress = &progress;
    jpeg_mem_src(&info, bytes.data(), static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&info, TRUE);
    return true;
  }
  bool start() {
    if (setjmp(errors.jump)) return false;
    info.dct_method = JDCT_ISLOW;
    jpeg_start_decompress(&info);
    return true;
  }
  bool readRow(JSAMPLE* row) {
    if (setjmp(errors.jump)) return false;
    jpeg_read_scanlines(&info, &row, 1);
    return true;
  }
  bool finish() {
    if (setjmp(errors.jump)) return false;
    jpeg_finish_decompress(&info);
    return true;
  }
};

struct Encoder {
  JpegErrors errors;
  jpeg_compress_struct info{};
  jpeg_destination_mgr destination{};
  JOCTET chunk[65536];
  std::vector<std::uint8_t> output;
  ~Encoder() { jpeg_destroy_compress(&info); }

  void flush(std::size_t used) {
    output.insert(output.end(), chunk, chunk + used);
    destination.next_output_byte = chunk;
    destination.free_in_buffer = sizeof(chunk);
  }
  static void onStart(j_compress_ptr info) { static_cast<Encoder*>(info->client_data)->flush(0); }
  static boolean onFull(j_compress_ptr info) {
    static_cast<Encoder*>(info->client_data)->flush(sizeof(chunk));
    return TRUE;
  }
  static void onEnd(j_compress_ptr info) {
    auto* self = static_cast<Encoder*>(info->client_data);
    self->flush(sizeof(chunk) - self->destination.free_in_buffer);
  }

  bool start(const Image& image, int channels, int quality, bool drawn) {
    info.err = install(errors);
    if (setjmp(errors.jump)) return false;
    jpeg_create_compress(&info);
    info.client_data = this;
    destination.init_destination = onStart;
    destination.empty_output_buffer = onFull;
    destination.term_destination = onEnd;
    info.dest = &destination;
    info.image_width = static_cast<JDIMENSION>(image.width);
    info.image_height = static_cast<JDIMENSION>(image.height);
    info.input_components = channels;
    info.in_color_space = channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, quality, TRUE);
    for (int i = 0; i < info.num_components; ++i) {  // colours as fine as light: photographs are trained from these
      info.comp_info[i].h_samp_factor = info.comp_info[i].v_samp_factor = 1;
    }
    jpeg_start_compress(&info, TRUE);
    if (drawn) {
      jpeg_write_marker(&info, JPEG_COM, reinterpret_cast<const JOCTET*>(kDrawnBy.data()),
                        static_cast<unsigned>(kDrawnBy.size()));
    }
    return true;
  }
  bool writeRow(JSAMPLE* row) {
    if (setjmp(errors.jump)) return false;
    jpeg_write_scanlines(&info, &row, 1);
    return true;
  }
  bool finish() {
    if (setjmp(errors.jump)) return false;
    jpeg_finish_compress(&info);
    return true;
  }
};

}  // namespace

Image decodeJpeg(std::span<const std::uint8_t> bytes, const std::string& path) {
  Decoder decoder;
  const auto fail = [&] {
    return Error(ErrorKind::badData, path, std::string("broken JPEG: ") + decoder.errors.message);
  };
  if (!decoder.readHeader(bytes)) throw fail();
  if (decoder.info.arith_code) {
    throw Error(ErrorKind::badData, path, "JPEG with arithmetic coding (expected Huffman coding)");
  }
  const int channels = decoder.info.num_components;
  if (channels != 1 && channels != 3) {
    throw Error(ErrorKind::badData, path,
                "unsupported JPEG colours (expected 1 or 3 components, found " + std::to_string(channels) + ")");
  }
  decoder.info.out_color_space = channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  // Huffman codes spend at least one bit on a block of 8 x 8 pixels.
  checkImageSize(decoder.info.image_width, decoder.info.image_height, 1, bytes.size(), 512, path);
  if (!decoder.start()) throw fail();
  Image image(static_cast<int>(decoder.info.output_width), static_cast<int>(decoder.info.output_height), channels);
  const std::size_t row_values = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(channels);
  std::vector<JSAMPLE> row(row_values);
  for (int y = 0; y < image.height; ++y) {
    if (!decoder.readRow(row.data())) throw fail();
    float* to = image.data.data() + static_cast<std::size_t>(y) * row_values;
    for (std::size_t i = 0; i < row_values; ++i) to[i] = static_cast<float>(row[i]) / 255.0f;
  }
  if (!decoder.finish()) throw fail();
  return image;
}

std::vector<std::uint8_t> encodeJpeg(const Image& image, int quality, bool drawn, const std::string& path) {
  TG_ASSERT(hasImageShape(image), "the image's data has its size");
  TG_ASSERT(quality >= 1 && quality <= 100, "a quality from 1 to 100");
  const int channels = std::min(image.channels, 3);  // JPEG has no alpha
  Encoder encoder;
  const auto fail = [&] { return Error(ErrorKind::cannotWrite, path, std::string("JPEG: ") + encoder.errors.message); };
  if (!encoder.start(image, channels, quality, drawn)) throw fail();
  std::vector<JSAMPLE> row(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(channels));
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < channels; ++c) {
        const float v = image.at(x, y, c);
        row[static_cast<std::size_t>(x * channels + c)] =
            v > 0.0f ? static_cast<JSAMPLE>(std::min(v, 1.0f) * 255.0f + 0.5f) : JSAMPLE{0};
      }
    }
    if (!encoder.writeRow(row.data())) throw fail();
  }
  if (!encoder.finish()) throw fail();
  return std::move(encoder.output);
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Decoders, EXIF by libexif, HEIC by libheif, and the few loops over pixels.
#include "training/photos/photograph.h"

#include <libexif/exif-data.h>
#include <libheif/heif.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "core/file/file.h"
#include "core/image/webp.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "training/photos/hdr.h"
#include "training/photos/heif_references.h"
#include "training/photos/heif_sizes.h"

namespace tg {
namespace {

namespace fs = std::filesystem;
using Bytes = std::span<const std::uint8_t>;

constexpr std::uint64_t kMaxPhotographBytes = std::uint64_t{1} << 30;
constexpr std::uint64_t kAlwaysAllowed = std::uint64_t{64} << 20;  // [bytes] of pixels
constexpr std::uint64_t kMaxRatio = 3000;                          // bytes of pixels in one of HEIC
constexpr double kFilmDiagonal = 43.2666;                        // [mm] of 36 x 24
constexpr double kSameShape = 0.02;                              // relative difference of two aspect ratios
constexpr double kShortest = 0.1, kLongest = 50;  // focal length over diagonal: what is beyond is no lens

// The numbers of an entry, as many as it has.
std::vector<double> numbersOf(ExifData* data, ExifIfd ifd, ExifTag tag) {
  ExifEntry* const entry = exif_content_get_entry(data->ifd[ifd], tag);
  std::vector<double> numbers;
  if (entry == nullptr || entry->data == nullptr) return numbers;
  const ExifByteOrder order = exif_data_get_byte_order(data);
  const std::size_t size = exif_format_get_size(entry->format);
  for (std::size_t i = 0; size > 0 && i < entry->components && (i + 1) * size <= entry->size; ++i) {
    const unsigned char* const at = entry->data + i * size;
    switch (entry->format) {
      case EXIF_FORMAT_SHORT:
        numbers.push_back(exif_get_short(at, order));
        break;
      case EXIF_FORMAT_LONG:
        numbers.push_back(exif_get_long(at, order));
        break;
      case EXIF_FORMAT_RATIONAL: {
        const ExifRational ratio = exif_get_rational(at, order);
        numbers.push_back(ratio.denominator > 0 ? double(ratio.numerator) / ratio.denominator : 0.0);
        break;
      }
      default:
        return {};
    }
  }
  return numbers;
}
double numberOf(ExifData* data, ExifIfd ifd, ExifTag tag) {
  const std::vector<double> numbers = numbersOf(data, ifd, tag);
  return numbers.empty() ? 0 : numbers[0];
}
std::string textOf(ExifData* data, ExifIfd ifd, ExifTag tag) {
  ExifEntry* const entry = exif_content_get_entry(data->ifd[ifd], tag);
  if (entry == nullptr || entry->format != EXIF_FORMAT_ASCII || entry->data == nullptr) return {};
  std::string text(reinterpret_cast<const char*>(entry->data), entry->size);
  text = printable(text.substr(0, text.find('\0')));
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

// 0: not said. None: not the picture's.
std::optional<double> focalPerDiagonal(ExifData* data, int width, int height) {
  const double taken_width = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_X_DIMENSION);
  const double taken_height = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_Y_DIMENSION);
  if (taken_width > 0 && taken_height > 0) {
    const auto shape = [](double a, double b) { return std::max(a, b) / std::min(a, b); };
    if (std::abs(shape(taken_width, taken_height) / shape(width, height) - 1) > kSameShape) return std::nullopt;
  }
  double ratio = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM) / kFilmDiagonal;
  if (ratio == 0 && taken_width > 0 && taken_height > 0) {
    const double focal = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH);                                 // [mm]
    const double unit = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT) == 3 ? 10 : 25.4;  // [mm]
    const double density = numberOf(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION) / unit;  // [px/mm]
    ratio = focal * density / std::hypot(taken_width, taken_height);
  }
  if (ratio != 0 && (ratio < kShortest || ratio > kLongest)) return std::nullopt;
  return ratio;
}

std::optional<Place> placeOf(ExifData* data) {
  const auto angle = [&](int tag, int reference_tag, char negative) -> std::optional<double> {
    const std::vector<double> parts = numbersOf(data, EXIF_IFD_GPS, static_cast<ExifTag>(tag));
    if (parts.size() != 3) return std::nullopt;
    const double degrees = parts[0] + parts[1] / 60 + parts[2] / 3600;
    return textOf(data, EXIF_IFD_GPS, static_cast<ExifTag>(reference_tag)).starts_with(negative) ? -degrees : degrees;
  };
  const auto latitude = angle(EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, 'S');
  const auto longitude = angle(EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, 'W');
  if (!latitude || !longitude || std::abs(*latitude) > 90 || std::abs(*longitude) > 180) return std::nullopt;
  if (*latitude == 0 && *longitude == 0) return std::nullopt;  // what cameras write without a signal
  return Place{*latitude, *longitude};
}

// The EXIF block of a JPEG, of a PNG (chunk eXIf) or of a WebP; empty where there is none.
Bytes exifOfJpeg(Bytes bytes) {
  for (std::size_t at = 2; at + 4 <= bytes.size() && bytes[at] == 0xff && bytes[at + 1] != 0xda;) {
    const std::size_t size = bytes[at + 2] * 256u + bytes[at + 3];
    if (size < 2 || at + 2 + size > bytes.size()) break;
    const Bytes segment = bytes.subspan(at + 4, size - 2);
    if (bytes[at + 1] == 0xe1 && segment.size() > 6 && std::memcmp(segment.data(), "Exif\0", 6) == 0) return segment;
    at += 2 + size;
  }
  return {};
}
Bytes exifOfChunks(Bytes bytes, std::size_t start, std::string_view kind, bool png) {
  for (std::size_t at = start; at + 8 <= bytes.size();) {
    const auto byte = [&](std::size_t i) { return std::size_t{bytes[at + (png ? i : 7 - i)]}; };
    const std::size_t size = byte(0) << 24 | byte(1) << 16 | byte(2) << 8 | byte(3);
    if (size > bytes.size() - at - 8) break;
    const char* const name = reinterpret_cast<const char*>(bytes.data() + at + (png ? 4 : 0));
    if (std::string_view(name, 4) == kind) return bytes.subspan(at + 8, size);
    at += 8 + size + (png ? 4 : size % 2);
  }
  return {};
}

Image fromBytes(const std::uint8_t* bytes, std::size_t stride, int width, int height, int channels) {
  Image image(width, height, channels);
  parallelFor(height, 16, [&](std::int64_t y) {
    float* const row = &image.data[static_cast<std::size_t>(y) * width * channels];
    for (int i = 0; i < width * channels; ++i) row[i] = static_cast<float>(bytes[y * stride + i]) / 255.0f;
  });
  return image;
}

// Colour alone where nothing is transparent.
Image withoutOpaqueAlpha(Image image) {
  if (image.channels != 4) return image;
  for (std::size_t i = 3; i < image.data.size(); i += 4) {
    if (image.data[i] < 1) return image;
  }
  Image colour(image.width, image.height, 3);
  for (std::size_t i = 0, j = 0; i < image.data.size(); i += 4, j += 3) {
    std::copy_n(&image.data[i], 3, &colour.data[j]);
  }
  return colour;
}

// 16-bit numbers, low byte first, of which `bits` say something.
Image fromWords(const std::uint8_t* bytes, std::size_t stride, int width, int height, int bits) {
  Image image(width, height, 3);
  const float largest = static_cast<float>((1 << bits) - 1);
  parallelFor(height, 16, [&](std::int64_t y) {
    float* const row = &image.data[static_cast<std::size_t>(y) * width * 3];
    for (int i = 0; i < width * 3; ++i) {
      const std::uint8_t* const at = bytes + y * stride + std::size_t{2} * i;
      row[i] = static_cast<float>(at[0] | at[1] << 8) / largest;
    }
  });
  return image;
}

// How a picture of libheif says that it is in HDR, and its primaries.
std::pair<Transfer, int> lightOf(const heif_image_handle* handle) {
  heif_color_profile_nclx* found = nullptr;
  if (heif_image_handle_get_luma_bits_per_pixel(handle) <= 8 ||
      heif_image_handle_get_nclx_color_profile(handle, &found).code != heif_error_Ok) {
    return {Transfer::sdr, 0};
  }
  const std::unique_ptr<heif_color_profile_nclx, void (*)(heif_color_profile_nclx*)> profile(
      found, heif_nclx_color_profile_free);
  const auto curve = profile->transfer_characteristics;
  return {curve == heif_transfer_characteristic_ITU_R_BT_2100_0_PQ    ? Transfer::pq
          : curve == heif_transfer_characteristic_ITU_R_BT_2100_0_HLG ? Transfer::hlg
                                                                      : Transfer::sdr,
          profile->color_primaries};
}

// libheif turns the picture upright by itself, whatever the EXIF block says.
TakenPhotograph readHeif(Bytes bytes, const std::string& path) {
  const auto check = [&](const heif_error& error) {
    if (error.code != heif_error_Ok) {
      throw Error(ErrorKind::badData, path, std::string("broken HEIC: ") + (error.message ? error.message : "?"));
    }
  };
  const auto checkPixels = [&](std::uint64_t width, std::uint64_t height) {
    const std::uint64_t pixels = width * height;
    if (pixels < 1 || pixels > kMaxImagePixels) {
      throw Error(ErrorKind::badData, path, "image size out of range" + atMost(kMaxImagePixels, pixels));
    }
    if (3 * pixels > kAlwaysAllowed && 3 * pixels / kMaxRatio > bytes.size()) {
      throw Error(ErrorKind::badData, path,
                  "file is too short for its image size (found " + std::to_string(bytes.size()) + " bytes for " +
                      std::to_string(pixels) + " pixels)");
    }
  };
  checkHeifReferences(bytes, path);
  if (const std::uint64_t largest = largestHeifPicture(bytes, path); largest > 0) checkPixels(largest, 1);
  const std::unique_ptr<heif_context, void (*)(heif_context*)> context(heif_context_alloc(), heif_context_free);
  if (!context) throw std::bad_alloc();
  check(heif_context_read_from_memory_without_copy(context.get(), bytes.data(), bytes.size(), nullptr));
  heif_image_handle* opened = nullptr;
  check(heif_context_get_primary_image_handle(context.get(), &opened));
  const std::unique_ptr<heif_image_handle, void (*)(const heif_image_handle*)> handle(opened,
                                                                                      heif_image_handle_release);
  checkPixels(heif_image_handle_get_width(opened), heif_image_handle_get_height(opened));
  const auto [transfer, primaries] = lightOf(opened);
  const bool hdr = transfer != Transfer::sdr;
  heif_image* decoded = nullptr;
  check(heif_decode_image(opened, &decoded, heif_colorspace_RGB,
                          hdr ? heif_chroma_interleaved_RRGGBB_LE : heif_chroma_interleaved_RGB, nullptr));
  const std::unique_ptr<heif_image, void (*)(const heif_image*)> pixels(decoded, heif_image_release);
  int stride = 0;
  const std::uint8_t* const plane = heif_image_get_plane_readonly(decoded, heif_channel_interleaved, &stride);
  if (plane == nullptr) throw Error(ErrorKind::badData, path, "broken HEIC: no pixels");
  const int width = heif_image_get_width(decoded, heif_channel_interleaved);
  const int height = heif_image_get_height(decoded, heif_channel_interleaved);
  checkPixels(width, height);
  const auto step = static_cast<std::size_t>(stride);
  TakenPhotograph photograph;
  if (hdr) {
    const int bits = heif_image_get_bits_per_pixel_range(decoded, heif_channel_interleaved);
    if (bits < 9 || bits > 16) throw Error(ErrorKind::badData, path, "broken HEIC: " + std::to_string(bits) + " bits");
    photograph.image = toneMapped(fromWords(plane, step, width, height, bits), transfer, primaries);
  } else {
    photograph.image = fromBytes(plane, step, width, height, 3);
  }
  heif_item_id id = 0;
  if (heif_image_handle_get_list_of_metadata_block_IDs(opened, "Exif", &id, 1) == 1) {
    std::vector<std::uint8_t> block(heif_image_handle_get_metadata_size(opened, id));
    if (block.size() > 4 && heif_image_handle_get_metadata(opened, id, block.data()).code == heif_error_Ok) {
      // Its first four bytes say how far behind them the block begins.
      const std::size_t skip = 4 + (std::size_t{block[0]} << 24 | block[1] << 16 | block[2] << 8 | block[3]);
      if (skip < block.size()) {
        photograph.facts = readExif(Bytes(block).subspan(skip), photograph.image.width, photograph.image.height);
      }
    }
  }
  photograph.facts.orientation = 1;
  return photograph;
}

}  // namespace

ExifFacts readExif(Bytes block, int width, int height) {
  ExifFacts facts;
  if (block.size() < 8 || block.size() > 1u << 20) return facts;
  // libexif wants the six bytes that JPEG has before the block.
  std::vector<unsigned char> prefixed(block.begin(), block.end());
  constexpr std::array<unsigned char, 6> prefix = {'E', 'x', 'i', 'f', 0, 0};
  if (!std::equal(prefix.begin(), prefix.end(), prefixed.begin())) {
    prefixed.insert(prefixed.begin(), prefix.begin(), prefix.end());
  }
  const std::unique_ptr<ExifData, void (*)(ExifData*)> data(
      exif_data_new_from_data(prefixed.data(), static_cast<unsigned>(prefixed.size())), exif_data_unref);
  if (!data) return facts;
  const double orientation = numberOf(data.get(), EXIF_IFD_0, EXIF_TAG_ORIENTATION);
  if (orientation >= 1 && orientation <= 8) facts.orientation = static_cast<int>(orientation);
  const std::string make = textOf(data.get(), EXIF_IFD_0, EXIF_TAG_MAKE);
  const std::string model = textOf(data.get(), EXIF_IFD_0, EXIF_TAG_MODEL);
  facts.camera = model.starts_with(make) ? model : make.empty() ? model : make + " " + model;
  const std::optional<double> focal = focalPerDiagonal(data.get(), width, height);
  facts.focal_per_diagonal = focal.value_or(0);
  facts.focal_refused = !focal;
  facts.place = placeOf(data.get());
  return facts;
}

TakenPhotograph readPhotograph(const fs::path& file) {
  return decodePhotograph(readRegularFile(file, kMaxPhotographBytes), file.string());
}

TakenPhotograph decodePhotograph(Bytes bytes, const std::string& path) {
  const PictureFormat format = pictureFormat(bytes);
  if (format == PictureFormat::heif) return readHeif(bytes, path);
  TakenPhotograph photograph;
  Bytes exif;
  if (format == PictureFormat::webp) {
    const BytePixels pixels = decodeWebp(bytes, path);
    photograph.image = fromBytes(pixels.data.data(), std::size_t{4} * pixels.width, pixels.width, pixels.height, 4);
    exif = exifOfChunks(bytes, 12, "EXIF", false);
  } else {
    photograph.image = decodeImage(bytes, path);
    exif = format == PictureFormat::jpeg ? exifOfJpeg(bytes) : exifOfChunks(bytes, 8, "eXIf", true);
  }
  photograph.facts = readExif(exif, photograph.image.width, photograph.image.height);
  constexpr std::size_t kDepthInPng = 24;  // of its header's bits a channel; COLMAP and others want 8 at most
  const bool readable = format == PictureFormat::jpeg || (format == PictureFormat::png && bytes[kDepthInPng] <= 8);
  if (readable && photograph.facts.orientation == 1 && !photograph.facts.focal_refused) photograph.as_stored = format;
  photograph.image = turned(withoutOpaqueAlpha(std::move(photograph.image)), photograph.facts.orientation);
  return photograph;
}

Image turned(Image image, int orientation) {
  if (orientation < 2 || orientation > 8) return image;
  const bool swaps = orientation >= 5;
  const bool mirrors_x = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool mirrors_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Image result(swaps ? image.height : image.width, swaps ? image.width : image.height, image.channels);
  parallelFor(result.height, 16, [&](std::int64_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < result.width; ++x) {
      // Where the stored picture holds this pixel.
      int from_x = swaps ? y : x, from_y = swaps ? x : y;
      if (mirrors_x) from_x = image.width - 1 - from_x;
      if (mirrors_y) from_y = image.height - 1 - from_y;
      for (int c = 0; c < image.channels; ++c) result.at(x, y, c) = image.at(from_x, from_y, c);
    }
  });
  return result;
}

Image reducedTo(Image image, int width, int height) {
  TG_ASSERT(width >= 1 && height >= 1 && width <= image.width && height <= image.height, "neither side grows");
  // What is transparent has no share in the colour.
  const bool transparent = image.channels == 4;
  for (std::size_t i = 0; transparent && i < image.data.size(); i += 4) {
    for (std::size_t c = 0; c < 3; ++c) image.data[i + c] *= image.data[i + 3];
  }
  // Along x, then along y: `length` samples, `stride` apart, become `count`.
  const auto reduce = [](const float* in, std::size_t stride, int length, float* out, std::size_t out_stride,
                         int count) {
    const double step = double(length) / count;
    for (int i = 0; i < count; ++i) {
      const double begin = i * step, end = std::min<double>(length, (i + 1) * step);
      double sum = 0;
      for (int j = static_cast<int>(begin); j < length && j < end; ++j) {
        sum += (std::min<double>(j + 1, end) - std::max<double>(j, begin)) * in[j * stride];
      }
      out[i * out_stride] = static_cast<float>(sum / (end - begin));
    }
  };
  const std::size_t channels = image.channels;
  Image narrow(width, image.height, image.channels);
  parallelFor(image.height, 16, [&](std::int64_t y) {
    for (std::size_t c = 0; c < channels; ++c) {
      reduce(&image.data[y * image.width * channels + c], channels, image.width, &narrow.data[y * width * channels + c],
             channels, width);
    }
  });
  Image result(width, height, image.channels);
  const std::size_t row = width * channels;
  parallelFor(static_cast<std::int64_t>(row), 64, [&](std::int64_t column) {
    reduce(&narrow.data[column], row, image.height, &result.data[column], row, height);
  });
  for (std::size_t i = 0; transparent && i < result.data.size(); i += 4) {
    const float alpha = result.data[i + 3];
    for (std::size_t c = 0; c < 3 && alpha > 0; ++c) result.data[i + c] /= alpha;
  }
  return result;
}

}  // namespace tg

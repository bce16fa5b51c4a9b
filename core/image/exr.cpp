// SPDX-License-Identifier: Apache-2.0
// OpenEXR scan-line files, to and from memory. The header is read here first: the library allocates from its numbers.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfCompression.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfOutputFile.h>
#include <half.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "core/image/codecs.h"
#include "core/system/assert.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr int kMaxSide = 65536;  // the library buffers up to 256 lines of pixels
constexpr int kMaxChannels = 32;
constexpr std::int64_t kMaxPixelRatio =
    4096;  // pixels to file: ZIP reaches 1032, PIZ and B44 less, flat DWA pictures more

// Bytes of the types of attributes that have a size of their own. The library reads as many whatever the header says,
// and takes what follows for the next attribute, of any size.
constexpr std::array<std::pair<std::string_view, std::size_t>, 23> kTypeBytes = {
    {{"box2f", 16},      {"box2i", 16},   {"chromaticities", 32},
     {"compression", 1}, {"double", 8},   {"envmap", 1},
     {"float", 4},       {"int", 4},      {"keycode", 28},
     {"lineOrder", 1},   {"m33d", 72},    {"m33f", 36},
     {"m44d", 128},      {"m44f", 64},    {"rational", 8},
     {"tiledesc", 9},    {"timecode", 8}, {"v2d", 16},
     {"v2f", 8},         {"v2i", 8},      {"v3d", 24},
     {"v3f", 12},        {"v3i", 12}}};

// Of channels "alpha": whether colours are multiplied by it.
constexpr const char* kAssociated = "tg:associated";

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::span<const std::uint8_t> bytes) : IStream("memory"), bytes_(bytes) {}
  bool read(char* to, int count) override {
    if (count < 0 || static_cast<std::uint64_t>(count) > bytes_.size() - position_) {
      throw std::runtime_error("file ends early");
    }
    std::memcpy(to, bytes_.data() + position_, static_cast<std::size_t>(count));
    position_ += static_cast<std::size_t>(count);
    return position_ < bytes_.size();
  }
  std::uint64_t tellg() override { return position_; }
  void seekg(std::uint64_t position) override {
    if (position > bytes_.size()) throw std::runtime_error("offset beyond the end of the file");
    position_ = position;
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::uint64_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : OStream("memory") {}
  void write(const char* from, int count) override {
    const std::size_t end = position_ + static_cast<std::size_t>(count);
    if (end > bytes.size()) bytes.resize(end);
    std::memcpy(bytes.data() + position_, from, static_cast<std::size_t>(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }

  std::vector<std::uint8_t> bytes;

 private:
  std::uint64_t position_ = 0;
};

struct Channel {
  std::string name;
  int type = 0;  // 0 UINT, 1 HALF, 2 FLOAT
};

struct Header {
  int min_x = 0, min_y = 0, width = 0, height = 0;
  int compression = -1;
  std::vector<Channel> channels;
};

// Walks the attributes of a single-part scan-line file, with every length checked against what is left.
class HeaderReader {
 public:
  HeaderReader(std::span<const std::uint8_t> bytes, const std::string& path)
      : file_bytes_(bytes.size()), left_(bytes), path_(path) {}

  Header read() {
    if (integer() != 20000630) fail("not an EXR file");
    const std::uint32_t version = static_cast<std::uint32_t>(integer());
    if ((version & 0xff) != 2) fail("unknown EXR version " + std::to_string(version & 0xff));
    if (version & 0x1a00) fail("tiled, deep or multi-part EXR (expected one part of scan lines)");
    bool has_window = false;
    for (;;) {
      const std::string name = text();
      if (name.empty()) break;
      const std::string type = text();
      const std::int32_t size = integer();
      if (size < 0 || static_cast<std::size_t>(size) > left_.size()) fail("attribute " + name + " leaves the file");
      HeaderReader value(left_.first(static_cast<std::size_t>(size)), path_);
      left_ = left_.subspan(static_cast<std::size_t>(size));
      if (const auto known = std::ranges::find(kTypeBytes, type, &std::pair<std::string_view, std::size_t>::first);
          known != kTypeBytes.end()) {
        value.checkBytes(known->second, name);
      }
      if (name == "dataWindow" && type == "box2i") {
        value.readWindow(header_);
        has_window = true;
      } else if (type == "chlist") {
        Header other;
        value.readChannels(name == "channels" ? header_ : other);
        if (!value.left_.empty()) fail("attribute " + name + " goes on behind its last channel");
      } else if (name == "compression" && type == "compression") {
        header_.compression = value.byte();
      } else {
        value.checkAttribute(name, type);
      }
    }
    if (!has_window || header_.channels.empty() || header_.compression < 0) {
      fail("EXR header lacks dataWindow, channels or compression");
    }
    checkSize();
    return header_;
  }

  // OpenEXR 3.1 says nothing of lines that it could not compress, which only memory can be the reason of. Of a file
  // with ZIP_COMPRESSION and nothing read yet.
  bool hasAllLines() {
    read();
    for (int y = 0; y < header_.height; y += 16) {
      const auto low = static_cast<std::uint32_t>(integer()), high = static_cast<std::uint32_t>(integer());
      const std::uint64_t offset = std::uint64_t{high} << 32 | low;
      if (offset == 0 || offset >= file_bytes_) return false;
    }
    return true;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, what); }

  int byte() {
    if (left_.empty()) fail("EXR header ends early");
    const int value = left_[0];
    left_ = left_.subspan(1);
    return value;
  }
  std::int32_t integer() {
    std::uint32_t value = 0;
    for (int shift = 0; shift < 32; shift += 8) value |= static_cast<std::uint32_t>(byte()) << shift;
    return static_cast<std::int32_t>(value);
  }
  std::string text() {
    std::string value;
    for (int c = byte(); c != 0; c = byte()) {
      if (value.size() == 255) fail("EXR header holds a name of more than 255 bytes");
      value.push_back(static_cast<char>(c));
    }
    return value;
  }

  void readWindow(Header& header) {
    const std::int64_t min_x = integer(), min_y = integer(), max_x = integer(), max_y = integer();
    constexpr std::int64_t far = 1 << 30;
    if (std::min(min_x, min_y) < -far || std::max(max_x, max_y) > far) fail("EXR data window is out of range");
    const std::int64_t width = max_x - min_x + 1, height = max_y - min_y + 1;
    if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide) {
      fail("image size out of range (expected 1 to " + std::to_string(kMaxSide) + " a side, found " +
           std::to_string(width) + " x " + std::to_string(height) + ")");
    }
    header.min_x = static_cast<int>(min_x);
    header.min_y = static_cast<int>(min_y);
    header.width = static_cast<int>(width);
    header.height = static_cast<int>(height);
  }

  void readChannels(Header& header) {
    header.channels.clear();
    for (std::string name = text(); !name.empty(); name = text()) {
      Channel channel{name, integer()};
      integer();  // pLinear and three reserved bytes
      const std::int32_t x_sampling = integer(), y_sampling = integer();
      if (channel.type < 0 || channel.type > 2) fail("channel " + name + " has an unknown type");
      if (x_sampling != 1 || y_sampling != 1) fail("channel " + name + " is subsampled (expected full resolution)");
      header.channels.push_back(std::move(channel));
      if (header.channels.size() > kMaxChannels) {
        fail("too many channels (expected at most " + std::to_string(kMaxChannels) + ")");
      }
    }
  }

  void checkBytes(std::size_t expected, const std::string& name) const {
    if (left_.size() == expected) return;
    fail("attribute " + name + " has a wrong size (expected " + std::to_string(expected) + ", found " +
         std::to_string(left_.size()) + " bytes)");
  }

  // The other attributes are the library's business, except where it allocates before it compares with the size, and
  // our own.
  void checkAttribute(const std::string& name, const std::string& type) {
    if (type == "preview") {
      const std::uint64_t size = left_.size();
      const std::uint64_t width = static_cast<std::uint32_t>(integer());
      const std::uint64_t height = static_cast<std::uint32_t>(integer());
      if (width * height != (size - 8) / 4 || size % 4 != 0) fail("attribute " + name + " has a wrong size");
    } else if (type == "stringvector") {
      while (!left_.empty()) {
        const std::int32_t length = integer();
        if (length < 0 || static_cast<std::size_t>(length) > left_.size()) fail("attribute " + name + " is broken");
        left_ = left_.subspan(static_cast<std::size_t>(length));
      }
    } else if (type == "floatvector") {
      checkBytes(left_.size() / sizeof(float) * sizeof(float), name);
    } else if (type == "idmanifest" || type == "deepImageState") {
      fail("attribute " + name + " belongs to deep EXR files");
    } else if (name == kAssociated && type == "int" && integer() != 0) {
      fail("attribute " + name + ": not supported (expected 0: alpha is not multiplied into the colours)");
    }
  }

  void checkSize() const {
    std::int64_t bytes_per_pixel = 0;
    for (const Channel& c : header_.channels) bytes_per_pixel += c.type == Imf::HALF ? 2 : 4;
    checkImageSize(header_.width, header_.height, bytes_per_pixel, file_bytes_, kMaxPixelRatio, path_);
    // One block of lines is the unit the library allocates, read or not.
    const std::int64_t lines = header_.compression == Imf::DWAB_COMPRESSION ? 256 : 32;
    if (header_.width * bytes_per_pixel * lines > (std::int64_t{1} << 30)) fail("image lines are too wide");
  }

  std::size_t file_bytes_;
  std::span<const std::uint8_t> left_;
  const std::string& path_;
  Header header_;
};

bool hasChannel(const Header& header, std::string_view name) {
  return std::any_of(header.channels.begin(), header.channels.end(), [&](const Channel& c) { return c.name == name; });
}

Image readChannels(std::span<const std::uint8_t> bytes, const Header& header, std::span<const std::string> names,
                   const std::string& path) {
  Image image(header.width, header.height, static_cast<int>(names.size()));
  try {
    MemoryInput input(bytes);
    Imf::InputFile file(input, 0);
    const Imath::Box2i& window = file.header().dataWindow();
    if (window.min.x != header.min_x || window.min.y != header.min_y ||
        window.max.x - window.min.x + 1 != header.width || window.max.y - window.min.y + 1 != header.height) {
      throw std::runtime_error("the data window is given twice");
    }
    if (!file.isComplete()) throw std::runtime_error("file ends early");
    Imf::FrameBuffer frame;
    const std::size_t x_stride = names.size() * sizeof(float);
    for (std::size_t c = 0; c < names.size(); ++c) {
      frame.insert(names[c], Imf::Slice::Make(Imf::FLOAT, image.data.data() + c, window, x_stride,
                                              x_stride * static_cast<std::size_t>(header.width)));
    }
    file.setFrameBuffer(frame);
    file.readPixels(window.min.y, window.max.y);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    std::string what = e.what();
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw Error(ErrorKind::badData, path, "broken EXR: " + what);
  }
  return image;
}

}  // namespace

ExrInfo readExrInfo(std::span<const std::uint8_t> bytes, const std::string& path) {
  const Header header = HeaderReader(bytes, path).read();
  ExrInfo info{header.width, header.height, {}};
  for (const Channel& c : header.channels) info.channels.push_back(c.name);
  return info;
}

Image decodeExr(std::span<const std::uint8_t> bytes, std::span<const std::string> channel_names,
                const std::string& path) {
  TG_ASSERT(!channel_names.empty(), "some channel is asked for");
  const Header header = HeaderReader(bytes, path).read();
  for (const std::string& name : channel_names) {
    if (hasChannel(header, name)) continue;
    std::string found;
    for (const Channel& c : header.channels) found += (found.empty() ? "" : ", ") + c.name;
    throw Error(ErrorKind::badData, path, "missing channel (expected " + name + ", found " + found + ")");
  }
  return readChannels(bytes, header, channel_names, path);
}

Image decodeExrPicture(std::span<const std::uint8_t> bytes, const std::string& path) {
  const Header header = HeaderReader(bytes, path).read();
  std::vector<std::string> names;
  if (hasChannel(header, "R") || hasChannel(header, "G") || hasChannel(header, "B")) {
    names = {"R", "G", "B"};
    if (hasChannel(header, "alpha")) {
      names.push_back("alpha");
    } else if (hasChannel(header, "A")) {
      names.push_back("A");
    }
  } else {
    names = {"Y"};
  }
  Image image = decodeExr(bytes, names, path);
  if (names.back() == "A") {
    for (std::size_t i = 0; i < image.data.size(); i += 4) {
      if (image.data[i + 3] > 0.0f) {
        for (std::size_t c = 0; c < 3; ++c) image.data[i + c] /= image.data[i + 3];
      }
    }
  }
  return image;
}

std::vector<std::uint8_t> encodeExr(const Image& image, std::span<const std::string> channel_names,
                                    const std::string& path) {
  TG_ASSERT(hasImageShape(image), "the image's data has its size");
  if (image.width < 1 || image.height < 1 || channel_names.size() != static_cast<std::size_t>(image.channels)) {
    throw Error(ErrorKind::cannotWrite, path,
                "image and channel names disagree (expected " + std::to_string(channel_names.size()) +
                    " channels, found " + std::to_string(image.channels) + ")");
  }
  std::vector<half> halves(image.data.size());
  for (std::size_t i = 0; i < halves.size(); ++i) {
    halves[i] = half(image.data[i]);
    if (!halves[i].isFinite() && std::isfinite(image.data[i])) {
      throw Error(
          ErrorKind::cannotWrite, path,
          "value does not fit a half float (expected at most 65504, found " + std::to_string(image.data[i]) + ")");
    }
  }
  try {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer frame;
    const std::size_t x_stride = channel_names.size() * sizeof(half);
    for (std::size_t c = 0; c < channel_names.size(); ++c) {
      header.channels().insert(channel_names[c], Imf::Channel(Imf::HALF));
      // A channel called A would be taken for premultiplied; "alpha" is not, and says so.
      if (channel_names[c] == "alpha") header.insert(kAssociated, Imf::IntAttribute(0));
      frame.insert(channel_names[c], Imf::Slice(Imf::HALF, reinterpret_cast<char*>(halves.data() + c), x_stride,
                                                x_stride * static_cast<std::size_t>(image.width)));
    }
    MemoryOutput output;
    {
      Imf::OutputFile file(output, header, 0);
      file.setFrameBuffer(frame);
      file.writePixels(image.height);
    }
    if (!HeaderReader(output.bytes, path).hasAllLines()) throw std::bad_alloc();
    return std::move(output.bytes);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    throw Error(ErrorKind::cannotWrite, path, e.what());
  }
}

std::vector<std::uint8_t> encodeExrPicture(const Image& image, const std::string& path) {
  TG_ASSERT(hasImageShape(image), "the image's data has its size");
  if (image.channels == 1) return encodeExr(image, std::vector<std::string>{"Y"}, path);
  if (image.channels == 3) return encodeExr(image, std::vector<std::string>{"R", "G", "B"}, path);
  Image premultiplied = image;
  for (std::size_t i = 0; i < premultiplied.data.size(); i += 4) {
    for (std::size_t c = 0; c < 3; ++c) premultiplied.data[i + c] *= premultiplied.data[i + 3];
  }
  return encodeExr(premultiplied, std::vector<std::string>{"R", "G", "B", "A"}, path);
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files, whole and broken, and what libwebp makes of each, for webp_test.mjs: to stdout, of each file the
// length of its name, its length, width and height (little endian, of 4 bytes; sides of 0: refused), name, bytes, RGBA.
#include <webp/decode.h>
#include <webp/encode.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <string>
#include <vector>

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kHeaderBytes = 5;  // signature and sides
std::mt19937 generator(1);

int random(int count) { return static_cast<int>(generator() % static_cast<unsigned>(count)); }
bool happens(double share) { return random(1000) < 1000 * share; }

void put(Bytes& out, std::size_t at, std::size_t value) {
  for (std::size_t k = 0; k < 4; ++k) out[at + k] = static_cast<std::uint8_t>(value >> 8 * k);
}

void writeCase(const std::string& name, const Bytes& file) {
  int width = 0, height = 0;
  std::uint8_t* pixels = WebPDecodeRGBA(file.data(), file.size(), &width, &height);
  if (pixels == nullptr) width = height = 0;
  Bytes head(16);
  put(head, 0, name.size());
  put(head, 4, file.size());
  put(head, 8, static_cast<std::size_t>(width));
  put(head, 12, static_cast<std::size_t>(height));
  std::fwrite(head.data(), 1, head.size(), stdout);
  std::fwrite(name.data(), 1, name.size(), stdout);
  std::fwrite(file.data(), 1, file.size(), stdout);
  std::fwrite(pixels, 4, static_cast<std::size_t>(width) * static_cast<std::size_t>(height), stdout);
  WebPFree(pixels);
}

Bytes encode(const WebPConfig& config, int width, int height, const Bytes& rgba) {
  WebPPicture picture;
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  if (!WebPPictureInit(&picture)) std::abort();
  picture.use_argb = 1;
  picture.width = width;
  picture.height = height;
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  if (!WebPPictureImportRGBA(&picture, rgba.data(), 4 * width) || !WebPEncode(&config, &picture)) std::abort();
  Bytes file(writer.mem, writer.mem + writer.size);
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&writer);
  return file;
}

struct Kind {
  const char* name;
  int width, height;
  std::function<std::uint32_t(int x, int y)> rgba;
};

std::uint32_t wave(int x, int y) {
  std::uint32_t rgba = 0;
  for (int k = 0; k < 4; ++k) {
    const double value = 128 + 60 * std::sin(0.05 * (k + 1) * x + 0.03 * y) + 50 * std::sin(0.11 * y - 0.02 * k * x);
    rgba |= static_cast<std::uint32_t>(std::clamp(value + random(5), 0.0, 255.0)) << 8 * k;
  }
  return rgba;
}

std::uint32_t anything(int, int) { return static_cast<std::uint32_t>(generator()); }

// One of `count` colours, in no order of the eye's.
std::uint32_t oneOf(int count, bool is_opaque) {
  const std::uint32_t color = static_cast<std::uint32_t>(random(count)) * 2654435761U + 12345;
  return is_opaque ? color | 0xFF000000U : color;
}

std::vector<Kind> kinds() {
  const auto of = [](int count, bool is_opaque) { return [=](int, int) { return oneOf(count, is_opaque); }; };
  return {
      {"a photograph", 83, 61, [](int x, int y) { return wave(x, y) | 0xFF000000U; }},
      {"a photograph with alpha", 90, 70, wave},
      {"noise", 57, 43, anything},
      {"one pixel", 1, 1, anything},
      {"a row", 300, 1, wave},
      {"a column", 1, 300, wave},
      {"a row of noise", 77, 1, anything},
      {"a flat picture", 500, 40, [](int, int) { return 0x80402010U; }},
      {"2 colours", 67, 31, of(2, true)},
      {"3 colours", 65, 31, of(3, false)},
      {"4 colours", 66, 31, of(4, true)},
      {"5 colours", 63, 31, of(5, false)},
      {"16 colours", 65, 33, of(16, true)},
      {"17 colours", 65, 33, of(17, false)},
      {"256 colours", 64, 65, of(256, false)},
      {"257 colours", 64, 65, of(257, false)},
      {"few colours beside each other", 130, 70,
       [](int x, int y) { return x / 9 % 2 == y / 7 % 3 ? 0xFF102030U : 0xFF405060U + static_cast<unsigned>(x / 40); }},
      {"nearly transparent", 71, 53, [](int, int) { return anything(0, 0) & 0x03FFFFFFU; }},
      {"transparent", 71, 53, [](int, int) { return anything(0, 0) & 0x00FFFFFFU; }},
      {"copies", 90, 50, [](int x, int y) { return wave(x % 23, y % 11) & 0xFFF8F8F8U; }},
      {"parts unlike each other", 64, 60, [](int x, int y) {
         return x / 16 % 2 == 0 ? wave(x, y) : y / 15 % 2 == 0 ? oneOf(9, true) : anything(0, 0) | 0xFF0000FFU;
       }}};
}

Bytes pixelsOf(const Kind& kind) {
  Bytes rgba;
  for (int y = 0; y < kind.height; ++y) {
    for (int x = 0; x < kind.width; ++x) {
      const std::uint32_t color = kind.rgba(x, y);
      for (int k = 0; k < 4; ++k) rgba.push_back(static_cast<std::uint8_t>(color >> 8 * k));
    }
  }
  return rgba;
}

void writeWhole() {
  for (const Kind& kind : kinds()) {
    const Bytes rgba = pixelsOf(kind);
    WebPConfig config;
    for (int level = 0; level <= 9; ++level) {
      if (!WebPConfigInit(&config) || !WebPConfigLosslessPreset(&config, level)) std::abort();
      config.exact = 1;
      writeCase(std::string(kind.name) + ", -z " + std::to_string(level),
                encode(config, kind.width, kind.height, rgba));
    }
    for (int method = 0; method <= 6; ++method) {
      if (!WebPConfigInit(&config)) std::abort();
      config.lossless = config.exact = 1;
      config.method = method;
      config.quality = 75;
      writeCase(std::string(kind.name) + ", -m " + std::to_string(method),
                encode(config, kind.width, kind.height, rgba));
    }
  }
}

// A file around `pixels`, which begin with VP8L's signature. Nothing fills it up to an even size: libwebp would take
// that for pixels, too.
Bytes fileOf(const Bytes& pixels) {
  const std::string head = "RIFF....WEBPVP8L....";
  Bytes file(head.size() + pixels.size());
  std::copy(head.begin(), head.end(), file.begin());
  std::copy(pixels.begin(), pixels.end(), file.begin() + static_cast<std::ptrdiff_t>(head.size()));
  put(file, 4, file.size() - 8);
  put(file, 16, pixels.size());
  return file;
}

// The pixels of an encoder's file.
Bytes pixelsIn(const Bytes& file) {
  const std::size_t size = file[16] + std::size_t{256} * file[17] + std::size_t{65536} * file[18];
  return Bytes(file.begin() + 20, file.begin() + static_cast<std::ptrdiff_t>(20 + size));
}

void writeBroken() {
  for (const Kind& kind :
       {Kind{"a photograph", 29, 21, wave}, Kind{"5 colours", 31, 17, [](int, int) { return oneOf(5, false); }},
        Kind{"copies", 40, 20, [](int x, int y) { return wave(x % 9, y % 5); }}}) {
    WebPConfig config;
    if (!WebPConfigInit(&config) || !WebPConfigLosslessPreset(&config, 6)) std::abort();
    config.exact = 1;
    const Bytes pixels = pixelsIn(encode(config, kind.width, kind.height, pixelsOf(kind)));
    for (std::size_t size = 5; size < pixels.size(); ++size) {
      writeCase(std::string(kind.name) + ", cut off after " + std::to_string(size),
                fileOf(Bytes(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(size))));
    }
    for (int i = 0; i < 400; ++i) {
      Bytes spoilt = pixels;
      for (int k = random(3); k >= 0; --k) {  // mostly where codes and transforms are told
        const int most = static_cast<int>(spoilt.size() - kHeaderBytes);
        const int at = random(i % 3 == 0 ? most : std::min(most, 80));
        std::uint8_t& byte = spoilt[kHeaderBytes + static_cast<std::size_t>(at)];
        byte = static_cast<std::uint8_t>(byte ^ 1 << random(8));
      }
      writeCase(std::string(kind.name) + ", spoilt " + std::to_string(i), fileOf(spoilt));
    }
  }
}

// What a format may hold though no encoder writes it: codes and transforms at random, and random bits for pixels, which
// complete codes take for some.
class Stream {
 public:
  Stream(int width, int height) : width_(width), height_(height) {
    bits(0x2F, 8);
    bits(width - 1, 14);
    bits(height - 1, 14);
    bits(random(2), 1);
    bits(happens(0.01) ? random(8) : 0, 3);
    std::vector<int> transforms{0, 1, 2, 3};
    std::shuffle(transforms.begin(), transforms.end(), generator);
    transforms.resize(static_cast<std::size_t>(random(5)));
    if (!transforms.empty() && happens(0.02)) transforms.push_back(transforms[0]);
    for (const int type : transforms) transform(type);
    bits(0, 1);
    image(width_, height_, true);
  }
  Bytes bytes() const { return bytes_; }

 private:
  void bits(int value, int count) {
    for (int k = 0; k < count; ++k, ++at_) {
      if (at_ % 8 == 0) bytes_.push_back(0);
      bytes_.back() = static_cast<std::uint8_t>(bytes_.back() | (value >> k & 1) << at_ % 8);
    }
  }

  void transform(int type) {
    bits(1, 1);
    bits(type, 2);
    if (type == 3) {
      const int colors = 1 + random(happens(0.5) ? 20 : 256);
      bits(colors - 1, 8);
      image(colors, 1, false);
      const int per_pixel = colors <= 2 ? 8 : colors <= 4 ? 4 : colors <= 16 ? 2 : 1;
      width_ = (width_ + per_pixel - 1) / per_pixel;
    } else if (type != 2) {
      blocks(false);
    }
  }

  void blocks(bool is_entropy) {
    const int size_bits = 2 + random(is_entropy ? 2 : 4);
    bits(size_bits - 2, 3);
    const int across = ((width_ - 1) >> size_bits) + 1, down = ((height_ - 1) >> size_bits) + 1;
    if (!is_entropy) {
      image(across, down, false);
      return;
    }
    // Numbers of two groups, those before and between them unused.
    const int first = random(4), second = first + random(5);
    bits(0, 1);
    simpleCode(first, second);
    simpleCode(0, -1);
    for (int k = 0; k < 3; ++k) simpleCode(random(2), -1);
    groups_ = 1;
    std::vector<int> numbers;
    for (int i = 0; i < across * down; ++i) {
      const int bit = random(2);
      if (second != first) bits(bit, 1);
      groups_ = std::max(groups_, (bit == 1 ? second : first) + 1);
    }
  }

  void simpleCode(int first, int second) {
    bits(1, 1);
    bits(second >= 0 ? 1 : 0, 1);
    bits(1, 1);
    bits(first, 8);
    if (second >= 0) bits(second, 8);
  }

  // Lengths of a complete code, as a tree has them that splits leaves at random, long ones where `is_deep`. Symbols
  // [begin, end) are not among them.
  void normalCode(int symbols, int most, bool is_deep, int begin = 0, int end = 0) {
    std::vector<int> leaves{0};
    while (static_cast<int>(leaves.size()) < most) {
      const std::size_t leaf =
          is_deep ? leaves.size() - 1 : static_cast<std::size_t>(random(static_cast<int>(leaves.size())));
      if (leaves[leaf] == 15) break;
      ++leaves[leaf];
      leaves.push_back(leaves[leaf]);
    }
    if (happens(0.01)) leaves[0] = random(16);  // no code any more
    leaves.resize(static_cast<std::size_t>(symbols - (end - begin)), 0);
    std::shuffle(leaves.begin(), leaves.end(), generator);
    leaves.insert(leaves.begin() + begin, static_cast<std::size_t>(end - begin), 0);
    bits(0, 1);
    bits(15, 4);
    for (int i = 0; i < 19; ++i) bits(i == 0 || i == 1 || i == 8 ? 0 : 4, 3);  // no kinds that repeat, 4 bits each
    bits(0, 1);
    for (const int length : leaves) {
      for (int k = 3; k >= 0; --k) bits(length >> k & 1, 1);
    }
  }

  void group(int cached) {
    const bool has_copies = happens(0.3);
    for (int k = 0; k < 5; ++k) {
      const int symbols = k == 0 ? 256 + 24 + cached : k < 4 ? 256 : 40;
      if (happens(0.3)) {
        simpleCode(random(k < 4 || happens(0.02) ? 256 : 8), happens(0.5) ? random(k < 4 ? 256 : 8) : -1);
      } else if (k == 4) {
        normalCode(symbols, 2 + random(6), happens(0.3), 8, 40);
      } else {
        const int most = 2 + random(happens(0.5) ? 12 : symbols - 26);
        normalCode(symbols, most, happens(0.3), 256, k == 0 && !has_copies ? 280 : 256);
      }
    }
  }

  void image(int width, int height, bool is_picture) {
    const int cache_bits = happens(0.5) ? 1 + random(happens(0.02) ? 15 : 11) : 0;
    bits(cache_bits > 0 ? 1 : 0, 1);
    if (cache_bits > 0) bits(cache_bits, 4);
    if (!is_picture) {  // of which it has to be known how many bits they take
      int per_pixel = 0;
      for (int k = 0; k < 5; ++k) {
        const int first = random(k == 4 ? 40 : 256), second = first ^ (1 + random(7));
        const bool has_two = k < 4 && happens(0.6);
        simpleCode(first, has_two ? second : -1);
        per_pixel += has_two ? 1 : 0;
      }
      for (int i = 0; i < per_pixel * width * height; ++i) bits(random(2), 1);
      return;
    }
    groups_ = 1;
    const bool has_blocks = happens(0.4);
    bits(has_blocks ? 1 : 0, 1);
    if (has_blocks) blocks(true);
    for (int i = 0; i < groups_; ++i) group(cache_bits > 0 ? 1 << cache_bits : 0);
    for (int i = 0; i < 8 * width * height; ++i) bits(random(256), 8);
  }

  Bytes bytes_;
  std::size_t at_ = 0;  // [bits]
  int width_, height_, groups_ = 1;
};

}  // namespace

int main() {
  writeWhole();
  writeBroken();
  for (int i = 0; i < 1000; ++i) {
    writeCase("a stream " + std::to_string(i), fileOf(Stream(1 + random(30), 1 + random(20)).bytes()));
  }
}

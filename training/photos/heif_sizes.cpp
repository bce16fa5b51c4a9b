// SPDX-License-Identifier: Apache-2.0
// Boxes to items, items to their bytes, and these up to the numbers of a size.
#include "training/photos/heif_sizes.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/system/error.h"
#include "training/photos/heif_boxes.h"

namespace tg {
namespace {

using ItemBytes = std::span<const std::uint8_t>;

constexpr std::uint64_t kMostTimes = 16;      // bytes of all pictures in one of the file
constexpr std::size_t kMostSpsBytes = 256;    // up to the size they are 110
constexpr std::uint64_t kNalLengthBytes = 4;  // as libheif gives them to libde265
constexpr std::array kPictures = {boxType("grid"), boxType("iovl"), boxType("hvc1"), boxType("hev1"), boxType("av01")};
constexpr int kSpsNal = 33, kSequenceHeaderObu = 1;

// Takes bits off the front, the highest of a byte first; zeros behind the end.
class BitCursor {
 public:
  explicit BitCursor(ItemBytes bytes) : bytes_(bytes) {}

  std::uint64_t take(int bits) {
    std::uint64_t value = 0;
    for (int k = 0; k < bits; ++k, ++at_) {
      const std::uint64_t bit = at_ / 8 < bytes_.size() ? bytes_[at_ / 8] >> (7 - at_ % 8) & 1 : 0;
      value = value << 1 | bit;
    }
    return value;
  }
  // ue(v) of HEVC, uvlc() of AV1.
  std::uint64_t golomb() {
    int zeros = 0;
    while (zeros < 32 && take(1) == 0) ++zeros;
    return zeros == 32 ? 0 : (std::uint64_t{1} << zeros) - 1 + take(zeros);
  }
  void skip(int bits) { at_ += static_cast<std::size_t>(bits); }

 private:
  ItemBytes bytes_;
  std::size_t at_ = 0;
};

// Of an SPS of HEVC (ITU-T H.265, 7.3.2.2) of the base layer; 0 for all other units.
std::uint64_t pixelsOfNal(ItemBytes nal) {
  constexpr int kProfileBits = 88, kLevelBits = 8;
  if (nal.size() < 2 || (nal[0] >> 1 & 63) != kSpsNal || (nal[0] & 1) != 0 || nal[1] >> 3 != 0) return 0;
  std::vector<std::uint8_t> raw;
  int zeros = 0;
  for (const std::uint8_t byte : nal.first(std::min(nal.size(), kMostSpsBytes)).subspan(2)) {
    const bool stuffed = zeros >= 2 && byte == 3;
    if (!stuffed) raw.push_back(byte);
    zeros = byte == 0 ? zeros + 1 : 0;
  }
  BitCursor bits(raw);
  bits.skip(4);
  const int sub_layers = static_cast<int>(bits.take(3));
  bits.skip(1 + kProfileBits + kLevelBits);
  int left_out = 0;
  for (int k = 0; k < sub_layers; ++k) {
    if (bits.take(1)) left_out += kProfileBits;
    if (bits.take(1)) left_out += kLevelBits;
  }
  if (sub_layers > 0) bits.skip(2 * (8 - sub_layers));
  bits.skip(left_out);
  bits.golomb();                         // its number
  if (bits.golomb() == 3) bits.skip(1);  // 4:4:4 says whether planes are coded apart
  const std::uint64_t width = bits.golomb();
  return width * bits.golomb();
}

// Of a sequence header of AV1 (AV1 Bitstream & Decoding Process Specification, 5.5.1).
std::uint64_t pixelsOfSequence(ItemBytes payload) {
  BitCursor bits(payload);
  bits.skip(3 + 1);  // profile, whether it is a still picture
  if (bits.take(1)) {
    bits.skip(5);  // level
  } else {
    int delay_bits = 0;
    if (bits.take(1)) {  // timing
      bits.skip(32 + 32);
      if (bits.take(1)) bits.golomb();
      if (bits.take(1)) {
        delay_bits = static_cast<int>(bits.take(5)) + 1;
        bits.skip(32 + 5 + 5);
      }
    }
    const bool delays = bits.take(1) != 0;
    for (std::uint64_t points = bits.take(5) + 1; points > 0; --points) {
      bits.skip(12);
      if (bits.take(5) > 7) bits.skip(1);
      if (delay_bits > 0 && bits.take(1)) bits.skip(2 * delay_bits + 1);
      if (delays && bits.take(1)) bits.skip(4);
    }
  }
  const int width_bits = static_cast<int>(bits.take(4)) + 1, height_bits = static_cast<int>(bits.take(4)) + 1;
  const std::uint64_t width = bits.take(width_bits) + 1;
  return width * (bits.take(height_bits) + 1);
}

std::uint64_t pixelsOfNals(ItemBytes data) {
  std::uint64_t most = 0;
  BoxCursor units(data);
  while (const auto length = units.number(kNalLengthBytes)) most = std::max(most, pixelsOfNal(units.take(*length)));
  return most;
}

std::uint64_t pixelsOfObus(ItemBytes data) {
  std::uint64_t most = 0;
  BoxCursor units(data);
  while (const auto head = units.number(1)) {
    if (*head & 4) units.number(1);  // layers
    std::uint64_t length = units.left().size();
    if (*head & 2) {
      length = 0;
      for (int shift = 0; shift < 56; shift += 7) {
        const std::uint64_t byte = units.number(1).value_or(0);
        length |= (byte & 127) << shift;
        if (byte < 128) break;
      }
    }
    const ItemBytes payload = units.take(length);
    if (static_cast<int>(*head >> 3 & 15) == kSequenceHeaderObu) most = std::max(most, pixelsOfSequence(payload));
  }
  return most;
}

// Version, flags, then `before` bytes, width and height.
std::uint64_t pixelsOfDerived(ItemBytes data, std::size_t before) {
  BoxCursor numbers(data);
  numbers.number(1);
  const std::size_t bytes = numbers.number(1).value_or(0) & 1 ? 4 : 2;
  numbers.take(before);
  const auto width = numbers.number(bytes), height = numbers.number(bytes);
  return width && height ? *width * *height : 0;
}

std::uint64_t pixelsOfItem(std::uint32_t type, ItemBytes data) {
  switch (type) {
    case boxType("grid"):
      return pixelsOfDerived(data, 2);  // rows and columns
    case boxType("iovl"):
      return pixelsOfDerived(data, 8);  // the background's colour
    case boxType("hvc1"):
    case boxType("hev1"):
      return pixelsOfNals(data);
    default:
      return pixelsOfObus(data);
  }
}

// What boxes `meta` tell of their items.
class Items {
 public:
  Items(ItemBytes file, const std::string& path) : file_(file), path_(path) {}

  void addMeta(ItemBytes meta) {
    if (meta.size() < kFullBoxBytes) return;
    types_.clear();
    idat_.reset();
    std::optional<ItemBytes> locations;
    for (BoxCursor boxes(meta.subspan(kFullBoxBytes)); const auto box = boxes.box();) {
      if (box->type == boxType("iinf")) addTypes(box->content);
      if (box->type == boxType("iprp")) addProperties(box->content);
      if (box->type == boxType("idat") && !idat_) idat_ = box->content;
      if (box->type == boxType("iloc") && !locations) locations = box->content;
    }
    if (locations) addLocations(*locations);
  }

  std::uint64_t mostPixels() const { return most_; }

 private:
  void addTypes(ItemBytes content) {
    BoxCursor entries(content);
    const auto version = entries.number(1);
    entries.take(version == 0u ? 3 + 2 : 3 + 4);  // flags, how many
    while (const auto entry = entries.box()) {
      BoxCursor numbers(entry->content);
      const auto entry_version = numbers.number(1);
      if (entry->type != boxType("infe") || entry_version.value_or(0) < 2) continue;
      numbers.take(3);
      const auto id = numbers.number(entry_version == 2u ? 2 : 4);
      numbers.number(2);  // protection
      const auto type = numbers.number(4);
      if (std::ranges::find(kPictures, type.value_or(0)) != kPictures.end()) types_.insert({*id, *type});
    }
  }

  void addProperties(ItemBytes content) {
    for (BoxCursor boxes(content); const auto box = boxes.box();) {
      if (box->type != boxType("ipco")) continue;
      for (BoxCursor properties(box->content); const auto property = properties.box();) {
        if (property->type == boxType("hvcC")) addHevc(property->content);
        if (property->type == boxType("av1C")) {
          BoxCursor units(property->content);
          units.take(4);
          most_ = std::max(most_, pixelsOfObus(units.left()));
        }
      }
    }
  }
  void addHevc(ItemBytes content) {
    BoxCursor arrays(content);
    arrays.take(22);
    for (std::uint64_t left = arrays.number(1).value_or(0); left > 0; --left) {
      arrays.number(1);  // of which kind
      for (std::uint64_t units = arrays.number(2).value_or(0); units > 0; --units) {
        const auto length = arrays.number(2);
        if (!length) return;
        most_ = std::max(most_, pixelsOfNal(arrays.take(*length)));
      }
    }
  }

  void addLocations(ItemBytes content) {
    BoxCursor numbers(content);
    const std::uint64_t version = numbers.number(1).value_or(0);
    numbers.take(3);
    const std::uint64_t sizes = numbers.number(2).value_or(0);
    const std::size_t offset_bytes = sizes >> 12, length_bytes = sizes >> 8 & 15, base_bytes = sizes >> 4 & 15;
    const std::size_t index_bytes = version > 0 ? sizes & 15 : 0;
    if (std::max({offset_bytes, length_bytes, base_bytes, index_bytes}) > 8) return;
    for (std::uint64_t left = numbers.number(version < 2 ? 2 : 4).value_or(0); left > 0; --left) {
      const auto id = numbers.number(version < 2 ? 2 : 4);
      if (!id) return;
      const std::uint64_t method = version > 0 ? numbers.number(2).value_or(0) & 15 : 0;
      numbers.number(2);  // another file, which is not opened
      const std::uint64_t base = numbers.number(base_bytes).value_or(0);
      BoxCursor extents(numbers.left());
      const std::uint64_t count = extents.number(2).value_or(0);
      numbers.take(2 + count * (index_bytes + offset_bytes + length_bytes));
      for (auto type = types_.lower_bound({*id, 0}); type != types_.end() && type->first == *id; ++type) {
        std::vector<ItemBytes> parts;
        BoxCursor entries(extents);
        for (std::uint64_t k = 0; k < count; ++k) {
          entries.number(index_bytes);
          const auto offset = entries.number(offset_bytes), length = entries.number(length_bytes);
          if (!offset || !length) break;
          BoxCursor source(method == 0 ? file_ : method == 1 ? idat_.value_or(ItemBytes()) : ItemBytes());
          source.take(base);
          source.take(*offset);
          parts.push_back(*length == 0 ? source.left() : source.take(*length));
          countBytes(parts.back().size());
        }
        addItem(type->second, parts);
      }
    }
  }
  void countBytes(std::size_t bytes) {
    taken_ += bytes + 1;
    const std::uint64_t most = kMostTimes * file_.size();
    if (taken_ > most) {
      throw Error(ErrorKind::badData, path_, "broken HEIC: pictures share bytes" + atMost(most, taken_));
    }
  }
  void addItem(std::uint32_t type, std::span<const ItemBytes> parts) {
    std::vector<std::uint8_t> joined;
    if (parts.size() > 1) {
      for (const ItemBytes part : parts) joined.insert(joined.end(), part.begin(), part.end());
    }
    most_ = std::max(most_, pixelsOfItem(type, parts.size() == 1 ? parts[0] : ItemBytes(joined)));
  }

  ItemBytes file_;
  const std::string& path_;
  std::optional<ItemBytes> idat_;
  std::set<std::pair<std::uint64_t, std::uint32_t>> types_;  // items that are pictures
  std::uint64_t taken_ = 0;                                  // [bytes] by pictures, and one for each part
  std::uint64_t most_ = 0;
};

}  // namespace

std::uint64_t largestHeifPicture(ItemBytes bytes, const std::string& path) {
  Items items(bytes, path);
  for (BoxCursor boxes(bytes); const auto box = boxes.box();) {
    if (box->type == boxType("meta")) items.addMeta(box->content);
  }
  return items.mostPixels();
}

}  // namespace tg

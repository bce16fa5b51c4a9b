// SPDX-License-Identifier: Apache-2.0
// Boxes in boxes, and a walk over what refers to what.
#include "training/photos/heif_references.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "core/system/error.h"

namespace tg {
namespace {

using Bytes = std::span<const std::uint8_t>;
using Item = std::uint32_t;

constexpr int kMostDeep = 4;  // a grid of tiles with a grid of their alpha is 2
constexpr std::uint64_t kMostVisits = 65536;
constexpr std::size_t kFullBoxBytes = 4;  // version and flags

constexpr std::uint32_t named(const char (&name)[5]) {
  std::uint32_t value = 0;
  for (int k = 0; k < 4; ++k) value = value << 8 | static_cast<unsigned char>(name[k]);
  return value;
}

// Takes big-endian numbers and boxes off the front; nothing once too few bytes are left.
class Cursor {
 public:
  explicit Cursor(Bytes bytes) : left_(bytes) {}

  std::optional<std::uint64_t> number(std::size_t bytes) {
    if (left_.size() < bytes) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t k = 0; k < bytes; ++k) value = value << 8 | left_[k];
    left_ = left_.subspan(bytes);
    return value;
  }

  struct Box {
    std::uint32_t type;
    Bytes content;
  };
  // One that says to be longer than what is there ends with it.
  std::optional<Box> box() {
    const std::size_t before = left_.size();
    const auto size = number(4), type = number(4);
    if (!size || !type) return std::nullopt;
    std::uint64_t length = *size;
    if (length == 1) length = number(8).value_or(0);
    if (length == 0) length = before;
    const std::size_t head = before - left_.size();
    if (length < head) return std::nullopt;
    const Bytes content = left_.first(std::min<std::uint64_t>(length - head, left_.size()));
    left_ = left_.subspan(content.size());
    return Box{static_cast<std::uint32_t>(*type), content};
  }

 private:
  Bytes left_;
};

class References {
 public:
  explicit References(Bytes file) {
    for (Cursor boxes(file); const auto box = boxes.box();) {
      if (box->type == named("meta")) addMeta(box->content);
    }
  }

  // Every picture with what it is made of.
  void check(const std::string& path) {
    for (const auto& [item, parts] : parts_) visit(item, 0, path);
  }

 private:
  void addMeta(Bytes content) {
    if (content.size() < kFullBoxBytes) return;
    for (Cursor boxes(content.subspan(kFullBoxBytes)); const auto box = boxes.box();) {
      if (box->type == named("iref")) addReferences(box->content);
    }
  }

  void addReferences(Bytes content) {
    if (content.size() < kFullBoxBytes) return;
    const std::size_t id_bytes = content[0] == 0 ? 2 : 4;
    for (Cursor boxes(content.subspan(kFullBoxBytes)); const auto box = boxes.box();) {
      if (box->type != named("dimg") && box->type != named("auxl")) continue;
      Cursor numbers(box->content);
      const auto from = numbers.number(id_bytes), count = numbers.number(2);
      for (std::uint64_t k = 0; from && k < count.value_or(0); ++k) {
        const auto to = numbers.number(id_bytes);
        if (!to) break;
        // The picture asks for its alpha, though it is the alpha that refers to the picture.
        const bool alpha = box->type == named("auxl");
        parts_[static_cast<Item>(alpha ? *to : *from)].push_back(static_cast<Item>(alpha ? *from : *to));
      }
    }
  }

  // The picture and all that it is made of.
  void visit(Item item, int deep, const std::string& path) {
    if (deep > kMostDeep) {
      throw Error(ErrorKind::badData, path,
                  "broken HEIC: pictures are made of each other" + atMost(kMostDeep, static_cast<std::uint64_t>(deep)));
    }
    if (++visits_ > kMostVisits) {
      throw Error(ErrorKind::badData, path, "broken HEIC: too many references" + atMost(kMostVisits, visits_));
    }
    const auto parts = parts_.find(item);
    if (parts == parts_.end()) return;
    for (const Item part : parts->second) visit(part, deep + 1, path);
  }

  std::map<Item, std::vector<Item>> parts_;
  std::uint64_t visits_ = 0;  // in all, also of what is visited again
};

}  // namespace

void checkHeifReferences(Bytes bytes, const std::string& path) { References(bytes).check(path); }

}  // namespace tg

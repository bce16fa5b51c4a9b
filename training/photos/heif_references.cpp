// SPDX-License-Identifier: Apache-2.0
// A walk over what refers to what.
#include "training/photos/heif_references.h"

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "core/system/error.h"
#include "training/photos/heif_boxes.h"

namespace tg {
namespace {

using Bytes = std::span<const std::uint8_t>;
using Item = std::uint32_t;

constexpr int kMostDeep = 4;  // a grid of tiles with a grid of their alpha is 2
constexpr std::uint64_t kMostVisits = 65536;

class References {
 public:
  explicit References(Bytes file) {
    for (BoxCursor boxes(file); const auto box = boxes.box();) {
      if (box->type == boxType("meta")) addMeta(box->content);
    }
  }

  // Every picture with what it is made of.
  void check(const std::string& path) {
    for (const auto& [item, parts] : parts_) visit(item, 0, path);
  }

 private:
  void addMeta(Bytes content) {
    if (content.size() < kFullBoxBytes) return;
    for (BoxCursor boxes(content.subspan(kFullBoxBytes)); const auto box = boxes.box();) {
      if (box->type == boxType("iref")) addReferences(box->content);
    }
  }

  void addReferences(Bytes content) {
    if (content.size() < kFullBoxBytes) return;
    const std::size_t id_bytes = content[0] == 0 ? 2 : 4;
    for (BoxCursor boxes(content.subspan(kFullBoxBytes)); const auto box = boxes.box();) {
      if (box->type != boxType("dimg") && box->type != boxType("auxl")) continue;
      BoxCursor numbers(box->content);
      const auto from = numbers.number(id_bytes), count = numbers.number(2);
      for (std::uint64_t k = 0; from && k < count.value_or(0); ++k) {
        const auto to = numbers.number(id_bytes);
        if (!to) break;
        // The picture asks for its alpha, though it is the alpha that refers to the picture.
        const bool alpha = box->type == boxType("auxl");
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

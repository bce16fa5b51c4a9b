// SPDX-License-Identifier: Apache-2.0
// PLY header and value parsing with every count checked against the file.
#include "core/bundle/ply_vertices.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>

#include "core/bundle/ply.h"
#include "core/model/model.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

constexpr std::size_t kMaxProperties = 4096;  // of one element; INRIA's layout has 62
constexpr std::size_t kBlock = 4096;          // vertices a thread takes at once
static_assert(std::endian::native == std::endian::little, "scalar loads below assume a little-endian machine");

template <typename T>
double load(const std::uint8_t* from, bool swap) {
  std::uint8_t raw[sizeof(T)];
  std::memcpy(raw, from, sizeof(T));
  if (swap) std::reverse(raw, raw + sizeof(T));
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return static_cast<double>(value);
}

struct Type {
  std::array<std::string_view, 2> names;
  std::size_t bytes;
  double (*load)(const std::uint8_t* from, bool swap);
};
template <typename T>
constexpr Type typeOf(std::string_view name, std::string_view sized_name) {
  return {{name, sized_name}, sizeof(T), load<T>};
}
constexpr std::array<Type, 8> kTypes{// as PlyType
                                     typeOf<std::int8_t>("char", "int8"),    typeOf<std::uint8_t>("uchar", "uint8"),
                                     typeOf<std::int16_t>("short", "int16"), typeOf<std::uint16_t>("ushort", "uint16"),
                                     typeOf<std::int32_t>("int", "int32"),   typeOf<std::uint32_t>("uint", "uint32"),
                                     typeOf<float>("float", "float32"),      typeOf<double>("double", "float64")};
const Type& typeOf(PlyType type) { return kTypes.at(static_cast<std::size_t>(type)); }

bool isSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r' || c == '\v' || c == '\f'; }

// Removes and returns the first word of `text`; "" at its end.
std::string_view nextWord(std::string_view& text) {
  std::size_t begin = 0;
  while (begin < text.size() && isSpace(text[begin])) ++begin;
  std::size_t end = begin;
  while (end < text.size() && !isSpace(text[end])) ++end;
  const std::string_view word = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return word;
}

// False when `word` is no number. Magnitudes beyond double become infinity or 0, as a C library would have it.
bool parseNumber(std::string_view word, double& number) {
  if (word.size() > 1 && word[0] == '+' && word[1] != '-') word.remove_prefix(1);
  number = 0.0;
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (end != word.data() + word.size() || word.empty()) return false;
  if (status == std::errc::result_out_of_range) {
    number = word.find("e-") != word.npos || word.find("E-") != word.npos ? 0.0 : HUGE_VAL;
  } else if (status != std::errc()) {
    return false;
  }
  return true;
}

// Words of a file in a message: short, and printable whatever they are.
std::string shownWord(std::string_view word) {
  std::string text = "\"";
  for (char c : word.substr(0, 40)) text += c >= ' ' && c <= '~' ? c : '?';
  return text + "\"";
}

}  // namespace

PlyVertices::PlyVertices(std::span<const std::uint8_t> bytes, const std::string& path, const char* noun,
                         std::string_view element)
    : PlyVertices(bytes, bytes.size(), path, noun, element) {}

PlyVertices::PlyVertices(std::span<const std::uint8_t> start, std::uint64_t total, const std::string& path,
                         const char* noun, std::string_view element)
    : path_(path), noun_(noun), body_(start), total_(total) {
  std::vector<Element> elements;
  parseHeader(elements);
  for (const Element& e : elements) element_names_.push_back(e.name);
  locateVertices(elements, element);
}

bool PlyVertices::hasElement(std::string_view name) const {
  return std::find(element_names_.begin(), element_names_.end(), name) != element_names_.end();
}

bool PlyVertices::hasProperties(std::span<const int> indices) const {
  return std::all_of(indices.begin(), indices.end(),
                     [this](int index) { return static_cast<std::size_t>(index) < properties_.size(); });
}

bool PlyVertices::plainFloats(std::span<const int> indices) const {
  TG_ASSERT(hasProperties(indices), "the file has these properties");
  return format_ == Format::little && std::all_of(indices.begin(), indices.end(), [this](int index) {
           return properties_[static_cast<std::size_t>(index)].type == PlyType::float32;
         });
}

int PlyVertices::requireWord(std::string_view name) const {
  const int index = require(name);
  if (format_ == Format::ascii || properties_[static_cast<std::size_t>(index)].type != PlyType::uint32) {
    fail("property " + std::string(name) + " is not stored as it must be (expected uint in a binary file)");
  }
  return index;
}

std::uint32_t PlyVertices::word(std::size_t vertex, int index) const {
  TG_ASSERT(vertex < count_ && static_cast<std::size_t>(index) < properties_.size(), "the file has this value");
  TG_ASSERT(format_ != Format::ascii && properties_[static_cast<std::size_t>(index)].type == PlyType::uint32,
            "a word is an uint of a binary file");
  const std::uint8_t* from = body_.data() + vertex * stride_ + properties_[static_cast<std::size_t>(index)].offset;
  std::uint32_t value;
  std::memcpy(&value, from, sizeof(value));
  return format_ == Format::big ? __builtin_bswap32(value) : value;
}

void PlyVertices::fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, what); }

int PlyVertices::find(std::string_view name) const {
  for (std::size_t i = 0; i < properties_.size(); ++i) {
    if (properties_[i].name == name) return static_cast<int>(i);
  }
  return -1;
}

int PlyVertices::require(std::string_view name) const {
  const int index = find(name);
  if (index < 0) fail("missing property " + std::string(name));
  return index;
}

int PlyVertices::shDegree(int lowest) const {
  const auto rest =
      std::ranges::count_if(properties_, [](const PlyProperty& p) { return p.name.starts_with("f_rest_"); });
  for (int degree = lowest; degree <= 3; ++degree) {
    if (static_cast<std::size_t>(rest) == 3 * (shCountOf(degree) - 1)) return degree;
  }
  fail(std::string("wrong number of f_rest properties (expected ") + (lowest == 0 ? "0, " : "") +
       "9, 24 or 45, found " + std::to_string(rest) + ")");
}

void PlyVertices::parseProperty(std::string_view line, Element& element) const {
  const std::string_view type_name = nextWord(line);
  if (type_name == "list") {
    element.has_list = true;
    return;
  }
  const auto type =
      std::ranges::find_if(kTypes, [&](const Type& t) { return std::ranges::count(t.names, type_name) > 0; });
  if (type == kTypes.end()) fail("PLY header: unknown property type " + shownWord(type_name));
  const std::string_view name = nextWord(line);
  if (name.empty() || !nextWord(line).empty()) fail("PLY header: property without exactly one name");
  if (std::any_of(element.properties.begin(), element.properties.end(),
                  [&](const PlyProperty& p) { return p.name == name; })) {
    fail("PLY header: property " + shownWord(name) + " is given twice");
  }
  if (element.properties.size() == kMaxProperties) {
    fail("PLY header: too many properties (expected at most " + std::to_string(kMaxProperties) + ")");
  }
  element.properties.push_back({std::string(name), static_cast<PlyType>(type - kTypes.begin()), element.stride});
  element.stride += type->bytes;
}

// Brush has "SplatRenderMode: default", "mip" or "2dgs", Postshot "antialiased 0" or "1".
void PlyVertices::parseComment(std::string_view line) {
  const std::string_view key = nextWord(line), value = nextWord(line);
  if (key == "SplatRenderMode:") antialiased_ = value == "mip";
  if (key == "antialiased") antialiased_ = value == "1";
}

void PlyVertices::parseHeader(std::vector<Element>& elements) {
  std::string_view text(reinterpret_cast<const char*>(body_.data()), std::min(body_.size(), kMaxPlyHeaderBytes));
  bool has_format = false;
  for (std::size_t line_number = 1;; ++line_number) {
    const std::size_t end = text.find('\n');
    if (end == text.npos) fail(line_number == 1 ? "not a PLY file" : "PLY header without end_header");
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end + 1);
    const std::string_view keyword = nextWord(line);
    if (line_number == 1) {
      if (keyword != "ply") fail("not a PLY file (expected \"ply\" in the first line)");
    } else if (keyword == "format") {
      const std::string_view format = nextWord(line), version = nextWord(line);
      if (format == "ascii") {
        format_ = Format::ascii;
      } else if (format == "binary_little_endian") {
        format_ = Format::little;
      } else if (format == "binary_big_endian") {
        format_ = Format::big;
      } else {
        fail("PLY header: unknown format " + shownWord(format));
      }
      if (version != "1.0") fail("PLY header: unknown version (expected 1.0, found " + shownWord(version) + ")");
      if (has_format) fail("PLY header: format is given twice");
      has_format = true;
    } else if (keyword == "element") {
      Element element;
      element.name = nextWord(line);
      const std::string_view count = nextWord(line);
      const auto [stop, status] = std::from_chars(count.data(), count.data() + count.size(), element.count);
      if (status != std::errc() || stop != count.data() + count.size()) {
        fail("PLY header: element " + shownWord(element.name) + " has no usable count (found " + shownWord(count) +
             ")");
      }
      elements.push_back(std::move(element));
    } else if (keyword == "property") {
      if (elements.empty()) fail("PLY header: property before the first element");
      parseProperty(line, elements.back());
    } else if (keyword == "end_header") {
      break;
    } else if (keyword == "comment") {
      parseComment(line);
    } else if (keyword != "obj_info" && !keyword.empty()) {
      fail("PLY header: unknown keyword " + shownWord(keyword));
    }
  }
  if (!has_format) fail("PLY header: no format");
  begin_ = static_cast<std::uint64_t>(reinterpret_cast<const std::uint8_t*>(text.data()) - body_.data());
  body_ = body_.subspan(static_cast<std::size_t>(begin_));
}

void PlyVertices::locateVertices(const std::vector<Element>& elements, std::string_view element) {
  const auto vertex =
      std::find_if(elements.begin(), elements.end(), [&](const Element& e) { return e.name == element; });
  if (vertex == elements.end()) fail("PLY without element " + std::string(element));
  for (auto e = elements.begin(); e <= vertex; ++e) {
    if (e->has_list) {
      fail("list property in element " + shownWord(e->name) + " (expected only after " + shownWord(element) + ")");
    }
    // Every ASCII value takes a digit and a separator, but for the last.
    const std::uint64_t size = format_ == Format::ascii ? 2 * e->properties.size() : e->stride;
    const std::uint64_t left = total_ - begin_ + (format_ == Format::ascii ? 1 : 0);
    if (size > 0 && e->count > left / size) {
      fail("file is too short for its counts (expected " + std::to_string(e->count) + " x " + shownWord(e->name) +
           ", found " + std::to_string(total_ - begin_) + " bytes)");
    }
    if (e == vertex) break;
    if (format_ == Format::ascii) {
      tokens_before_ += e->count * e->properties.size();
    } else {
      const std::uint64_t bytes = e->count * e->stride;
      begin_ += bytes;
      body_ = body_.subspan(static_cast<std::size_t>(std::min<std::uint64_t>(bytes, body_.size())));
    }
  }
  if (vertex->properties.empty()) fail("element " + std::string(element) + " has no properties");
  if (vertex->count > kMaxGaussians) {
    fail("too many rows of " + shownWord(element) + atMost(kMaxGaussians, vertex->count));
  }
  count_ = static_cast<std::size_t>(vertex->count);
  stride_ = vertex->stride;
  properties_ = vertex->properties;
  last_element_ = vertex + 1 == elements.end();
  if (format_ != Format::ascii && last_element_) trailing_ = total_ - begin_ - count_ * stride_;
}

std::string PlyVertices::label(std::size_t vertex) const {
  return std::string(noun_).append(" ").append(std::to_string(vertex));
}

void PlyVertices::failNotFinite(std::size_t vertex, int property) const {
  fail(label(vertex) + ": " + properties_[static_cast<std::size_t>(property)].name + " is not finite");
}

void PlyVertices::readAscii(std::span<const int> indices, const Visit& visit, bool must_be_finite,
                            std::span<const double> offsets) const {
  std::string_view text(reinterpret_cast<const char*>(body_.data()), body_.size());
  for (std::uint64_t i = 0; i < tokens_before_; ++i) {
    if (nextWord(text).empty()) fail("file ends before the vertices");
  }
  std::vector<double> row(properties_.size());
  std::vector<float> values(indices.size());
  for (std::size_t i = 0; i < count_; ++i) {
    for (std::size_t p = 0; p < row.size(); ++p) {
      const std::string_view word = nextWord(text);
      if (word.empty()) fail("file ends inside " + label(i) + " (expected " + std::to_string(count_) + ")");
      if (!parseNumber(word, row[p])) {
        fail(label(i) + ": " + properties_[p].name + " is no number (found " + shownWord(word) + ")");
      }
    }
    for (std::size_t k = 0; k < indices.size(); ++k) {
      const double value = row[static_cast<std::size_t>(indices[k])];
      values[k] = static_cast<float>(offsets.empty() ? value : value - offsets[k]);
      if (must_be_finite && !std::isfinite(values[k])) failNotFinite(i, indices[k]);
    }
    visit(i, values);
  }
  if (last_element_ && !nextWord(text).empty()) fail("file is longer than its counts say");
}

void PlyVertices::readBinary(std::span<const int> indices, const Visit& visit, bool must_be_finite,
                             std::span<const double> offsets) const {
  // The first offender of each block; -1: none. Reported in file order, whatever thread finds it.
  struct Offender {
    std::size_t vertex = 0;
    int property = -1;
  };
  std::vector<Offender> offenders((count_ + kBlock - 1) / kBlock);
  const bool swap = format_ == Format::big;
  parallelFor(static_cast<std::int64_t>(offenders.size()), 1, [&](std::int64_t block) {
    std::vector<float> values(indices.size());
    const std::size_t begin = static_cast<std::size_t>(block) * kBlock;
    for (std::size_t i = begin; i < std::min(count_, begin + kBlock); ++i) {
      const std::uint8_t* vertex = body_.data() + i * stride_;
      for (std::size_t k = 0; k < indices.size(); ++k) {
        const PlyProperty& property = properties_[static_cast<std::size_t>(indices[k])];
        const double value = typeOf(property.type).load(vertex + property.offset, swap);
        values[k] = static_cast<float>(offsets.empty() ? value : value - offsets[k]);
        if (must_be_finite && !std::isfinite(values[k])) {
          offenders[static_cast<std::size_t>(block)] = {i, indices[k]};
          return;
        }
      }
      visit(i, values);
    }
  });
  for (const Offender& o : offenders) {
    if (o.property >= 0) failNotFinite(o.vertex, o.property);
  }
}

void PlyVertices::read(std::span<const int> indices, const Visit& visit, bool must_be_finite,
                       std::span<const double> offsets) const {
  TG_ASSERT(hasProperties(indices), "the file has these properties");
  TG_ASSERT(begin_ + body_.size() == total_, "all of the file is at hand");
  TG_ASSERT(offsets.empty() || offsets.size() == indices.size(), "an offset a property");
  if (format_ == Format::ascii) {
    readAscii(indices, visit, must_be_finite, offsets);
  } else {
    readBinary(indices, visit, must_be_finite, offsets);
  }
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// One element of any PLY file, as a rule "vertex", as numbers: what the readers of PLY formats share.
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tg {

constexpr std::size_t kMaxPlyHeaderBytes = 1 << 20;

enum class PlyType { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::float32;
  std::size_t offset = 0;  // [bytes] in a binary vertex
};

class PlyVertices {
 public:
  // Parses the header and holds the element's count against the bytes that follow, before anything is allocated.
  // `bytes` must outlive this. `noun` is what messages call a row of `element`. Throws Error(badData).
  PlyVertices(std::span<const std::uint8_t> bytes, const std::string& path, const char* noun,
              std::string_view element = "vertex");
  // Of a file of `total` bytes whose start only is at hand, the header included: all but read() and word() may be
  // called.
  PlyVertices(std::span<const std::uint8_t> start, std::uint64_t total, const std::string& path, const char* noun,
              std::string_view element = "vertex");

  std::size_t size() const { return count_; }
  const std::vector<PlyProperty>& properties() const { return properties_; }
  int find(std::string_view name) const;         // index into properties(), or -1
  int require(std::string_view name) const;      // throws Error(badData) naming it
  int shDegree(int lowest = 0) const;            // of the properties f_rest_*; throws Error(badData)
  bool hasElement(std::string_view name) const;  // anywhere in the file
  bool antialiased() const { return antialiased_; }  // trained so, as the last comment says that speaks of it
  [[noreturn]] void fail(const std::string& what) const;

  // Rows are binary, little endian, and the properties are float32.
  bool plainFloats(std::span<const int> indices) const;
  std::uint64_t firstRow() const { return begin_; }     // [bytes] from the start of a binary file
  std::uint64_t trailing() const { return trailing_; }  // [bytes] behind the rows of a binary file's last element
  std::size_t stride() const { return stride_; }        // [bytes] of a binary row

  // A 32-bit pattern that a float would round: property `index` of a vertex, of type uint32 in a binary file.
  std::uint32_t word(std::size_t vertex, int index) const;
  // Throws Error(badData) unless word() may be called for this property.
  int requireWord(std::string_view name) const;

  // Calls visit(vertex, values) for every vertex, values[k] belonging to properties()[indices[k]]. From several threads
  // when binary. Throws Error(badData) naming the first vertex and property that is not finite, if they must be.
  using Visit = std::function<void(std::size_t vertex, std::span<const float> values)>;
  // offsets: one a property, which is taken away before the number becomes a float; none: 0.
  void read(std::span<const int> indices, const Visit& visit, bool must_be_finite = true,
            std::span<const double> offsets = {}) const;

 private:
  enum class Format { ascii, little, big };
  struct Element {
    std::string name;
    std::uint64_t count = 0;
    std::vector<PlyProperty> properties;
    bool has_list = false;
    std::size_t stride = 0;  // [bytes] when binary
  };

  void parseHeader(std::vector<Element>& elements);
  void parseComment(std::string_view line);
  void parseProperty(std::string_view line, Element& element) const;
  void locateVertices(const std::vector<Element>& elements, std::string_view element);
  void readAscii(std::span<const int> indices, const Visit& visit, bool must_be_finite,
                 std::span<const double> offsets) const;
  void readBinary(std::span<const int> indices, const Visit& visit, bool must_be_finite,
                  std::span<const double> offsets) const;
  bool hasProperties(std::span<const int> indices) const;
  std::string label(std::size_t vertex) const;  // "Gaussian 7"
  [[noreturn]] void failNotFinite(std::size_t vertex, int property) const;

  const std::string path_;
  const char* const noun_;
  std::span<const std::uint8_t> body_;  // after the header; from the first vertex on once located; what is at hand
  std::uint64_t begin_ = 0;             // [bytes] where body_ starts in the file
  std::uint64_t total_ = 0;             // [bytes] of the file
  Format format_ = Format::ascii;
  std::size_t count_ = 0;
  std::size_t stride_ = 0;
  bool last_element_ = false;
  bool antialiased_ = false;
  std::uint64_t trailing_ = 0;
  std::uint64_t tokens_before_ = 0;  // ASCII values of elements before the vertices
  std::vector<PlyProperty> properties_;
  std::vector<std::string> element_names_;
};

}  // namespace tg

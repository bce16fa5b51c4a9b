// SPDX-License-Identifier: Apache-2.0
// A glTF file under construction: JSON, and binary content that is made while it is written, so that it never stands in
// memory as a whole.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/formats/gaussian_blocks.h"
#include "core/file/file.h"

namespace tg {

// How elements of an attribute are stored. Strides are multiples of 4 bytes (glTF's rule); what is beyond an element is
// 0.
struct ElementType {
  const char* type = "SCALAR";  // "SCALAR", "VEC3", "VEC4"
  int component_type = 5126;    // glTF's number
  bool normalized = false;
  std::size_t bytes = 4;  // of an element without padding
  std::size_t stride() const { return (bytes + 3) / 4 * 4; }
};

// What EXT_meshopt_compression may do to an attribute before it is packed. All but none lose bits: `bits` are kept of
// each number or, `fixed`, multiples of 2^exponent.
struct MeshoptFilter {
  enum class Kind { none, quaternion, exponential, fixed } kind = Kind::none;
  int bits = 0;
  int exponent = 0;
  bool rounded = false;  // quaternion: `bits` on top of the 16 that the filter can keep, where they pack better
};

// A file's name as a relative URI (RFC 3986).
std::string uriOf(const std::string& name);

class GltfBuilder {
 public:
  // Writes a block's elements to `to`, `stride` bytes each, of zero-filled memory. From several threads.
  using Fill = std::function<void(const GaussianBlocks::Block& block, std::uint8_t* to)>;

  // Attributes have an element for each of the `gaussians`, which outlive this. `meshopt`: pack attributes by
  // EXT_meshopt_compression. `parts`: where each primitive but the last ends, ascending. Throws Error(usage) where the
  // library was not there to build with.
  explicit GltfBuilder(const GaussianBlocks& gaussians, bool meshopt = false, std::span<const std::size_t> parts = {});

  // An accessor for each primitive; the first one's index, the others follow. `bounded`: with min and max, of floats
  // that are not packed lossily. Packed attributes of few Gaussians stand one after the other in a view for all that
  // are of one stride and filter: JSON and what every stream costs are a part of small files that counts.
  std::size_t addAttribute(const ElementType& element, Fill fill, MeshoptFilter filter = {}, bool bounded = false);
  // A file inside the buffer; the index of its image.
  std::size_t addImage(std::vector<std::uint8_t> file, const std::string& mime_type, const std::string& name);

  // Atomic; bytes written. `path` starts messages. Throws Error(badData) beyond the 4 GiB of a GLB, Error(cannotWrite).
  std::uint64_t writeGlb(const std::filesystem::path& path);
  // A .gltf with NAME.bin and the images as files beside it, all of them or none, the .gltf last. `replace`: those that
  // are there already; otherwise they are an error. The sum of their sizes.
  std::uint64_t writeGltf(const std::filesystem::path& path, bool replace);
  std::size_t primitives() const { return ends_.size(); }
  // About what either would write, but for the JSON, and of packed attributes at most [bytes].
  std::uint64_t binaryBytes() const;

  nlohmann::ordered_json document;

 private:
  struct Attribute {
    std::uint64_t offset = 0;  // in the buffer
    std::size_t stride = 0;
    Fill fill;
    bool bounded = false;
    std::size_t accessor = 0;  // of the first primitive
  };
  struct Bounds;
  struct Blob {
    std::uint64_t offset = 0;
    std::vector<std::uint8_t> bytes;
    std::string file_name;  // of an image, after the document's name
    std::size_t view = 0;
    std::size_t image = 0;
  };

  void setBounds(std::size_t accessor, const Bounds& bounds);
  // Elements from `first` on into the bounds of their primitives.
  void addBounds(std::vector<Bounds>& bounds, std::size_t first, std::span<const std::uint8_t> bytes) const;
  std::uint64_t reserve(std::uint64_t bytes);
  std::size_t addView(std::uint64_t offset, std::uint64_t bytes);
  // Attributes that are packed together.
  struct OpenView {
    std::size_t view = 0;
    std::size_t stride = 0;
    std::string_view filter;
    std::vector<std::uint8_t> elements;
  };
  // Where the elements lie.
  struct Place {
    std::size_t view = 0;
    std::size_t offset = 0;  // [bytes]
    std::size_t stride = 0;
  };
  Place addPacked(const ElementType& element, const Fill& fill, MeshoptFilter filter, std::vector<Bounds>* bounds);
  // Packs those that are open: nothing is added to them any more.
  void packViews();
  void addBlob(std::vector<std::uint8_t> bytes, std::uint64_t offset);
  // The binary part at `base` of a file, in one pass over the Gaussians, and then the document's bounds.
  void writeBinary(const FileWriter& file, std::uint64_t base, bool with_images);
  nlohmann::ordered_json buffers(nlohmann::ordered_json first) const;

  const GaussianBlocks& gaussians_;
  const bool meshopt_;
  std::vector<std::size_t> ends_;  // of every primitive
  std::uint64_t binary_bytes_ = 0;
  std::uint64_t unpacked_bytes_ = 0;  // of the buffer that packed views stand for
  std::vector<Attribute> attributes_;
  std::vector<Blob> blobs_;
  std::vector<OpenView> open_views_;
};

}  // namespace tg

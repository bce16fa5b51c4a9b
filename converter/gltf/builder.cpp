// SPDX-License-Identifier: Apache-2.0
// A glTF file under construction.
#include "converter/gltf/builder.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>

#include "converter/gltf/container.h"
#include "converter/gltf/meshopt.h"
#include "core/file/atomic_files.h"
#include "core/system/assert.h"
#include "core/system/error.h"
#include "core/system/parallel.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMaxGlbBytes = 0xFFFFFFFFull;  // the header's 32 bits
constexpr std::size_t kBlock = 512;                    // Gaussians: with SH of degree 3 they stay in a core's cache
constexpr std::size_t kWrittenBlock = 64 * kBlock;     // that are written at once
constexpr int kArrayBuffer = 34962;
constexpr std::size_t kFewGaussians = 16384;  // whose packed attributes stand in one view

std::uint64_t aligned(std::uint64_t bytes) { return (bytes + 3) / 4 * 4; }

std::string textOf(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

std::string uriOf(const std::string& name) {
  constexpr const char* digits = "0123456789ABCDEF";
  std::string uri;
  for (const unsigned char c : name) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       std::string_view("-._~").find(static_cast<char>(c)) != std::string_view::npos;
    if (plain) {
      uri += static_cast<char>(c);
    } else {
      uri += '%';
      uri += digits[c >> 4];
      uri += digits[c & 15];
    }
  }
  return uri;
}

// Of the three floats of an element.
struct GltfBuilder::Bounds {
  glm::vec3 low{std::numeric_limits<float>::max()};
  glm::vec3 high{std::numeric_limits<float>::lowest()};

  void add(std::span<const std::uint8_t> elements) {
    for (; elements.size() >= sizeof(glm::vec3); elements = elements.subspan(sizeof(glm::vec3))) {
      glm::vec3 p;
      std::memcpy(&p, elements.data(), sizeof(p));
      low = glm::min(low, p);
      high = glm::max(high, p);
    }
  }
  void add(const Bounds& other) {
    low = glm::min(low, other.low);
    high = glm::max(high, other.high);
  }
};

GltfBuilder::GltfBuilder(const GaussianBlocks& gaussians, bool meshopt, std::span<const std::size_t> parts)
    : gaussians_(gaussians), meshopt_(meshopt), ends_(parts.begin(), parts.end()) {
  ends_.push_back(gaussians.size());
  TG_ASSERT(std::ranges::adjacent_find(ends_, std::greater_equal<>()) == ends_.end(), "primitives have Gaussians");
  if (meshopt && !hasMeshopt()) throw Error(ErrorKind::usage, "--meshopt: " + std::string(missingMeshopt()));
}

std::uint64_t GltfBuilder::reserve(std::uint64_t bytes) {
  const std::uint64_t offset = aligned(binary_bytes_);
  binary_bytes_ = offset + bytes;
  return offset;
}

std::size_t GltfBuilder::addView(std::uint64_t offset, std::uint64_t bytes) {
  Json& views = document["bufferViews"];
  views.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}});
  return views.size() - 1;
}

void GltfBuilder::addBlob(std::vector<std::uint8_t> bytes, std::uint64_t offset) {
  Blob blob;
  blob.offset = offset;
  blob.bytes = std::move(bytes);
  blobs_.push_back(std::move(blob));
}

// The zeros of both signs are one number in glTF: + 0 makes them one text.
void GltfBuilder::setBounds(std::size_t accessor, const Bounds& bounds) {
  const glm::vec3 low = bounds.low + 0.0f, high = bounds.high + 0.0f;
  document["accessors"][accessor]["min"] = {low.x, low.y, low.z};
  document["accessors"][accessor]["max"] = {high.x, high.y, high.z};
}

void GltfBuilder::addBounds(std::vector<Bounds>& bounds, std::size_t first, std::span<const std::uint8_t> bytes) const {
  const std::size_t last = first + bytes.size() / sizeof(glm::vec3);
  for (std::size_t p = 0; p < ends_.size(); ++p) {
    const std::size_t from = std::max(first, p == 0 ? 0 : ends_[p - 1]), to = std::min(last, ends_[p]);
    if (from < to) bounds[p].add(bytes.subspan((from - first) * sizeof(glm::vec3), (to - from) * sizeof(glm::vec3)));
  }
}

std::size_t GltfBuilder::addAttribute(const ElementType& element, Fill fill, MeshoptFilter filter, bool bounded) {
  TG_ASSERT(fill != nullptr && element.bytes > 0, "an attribute has elements and who fills them");
  const std::size_t index = document["accessors"].size();
  ElementType stored = element;
  std::vector<Bounds> bounds(ends_.size());
  Place place;
  if (meshopt_) {
    if (filter.kind == MeshoptFilter::Kind::quaternion) stored = {element.type, 5122, true, 8};
    place = addPacked(element, fill, filter, bounded ? &bounds : nullptr);
  } else {
    const std::uint64_t bytes = std::uint64_t{gaussians_.size()} * element.stride();
    const std::uint64_t offset = reserve(bytes);
    place = {addView(offset, bytes), 0, element.stride()};
    Json& view = document["bufferViews"].back();
    // Required where several accessors use a view.
    if (element.stride() != element.bytes || ends_.size() > 1) view["byteStride"] = element.stride();
    view["target"] = kArrayBuffer;
    attributes_.push_back({offset, element.stride(), std::move(fill), bounded, index});
  }
  for (std::size_t p = 0; p < ends_.size(); ++p) {
    const std::size_t first = p == 0 ? 0 : ends_[p - 1];
    Json accessor = {{"bufferView", place.view}};
    if (const std::size_t offset = place.offset + first * place.stride; offset > 0) accessor["byteOffset"] = offset;
    accessor["componentType"] = stored.component_type;
    if (stored.normalized) accessor["normalized"] = true;
    accessor["count"] = ends_[p] - first;
    accessor["type"] = stored.type;
    document["accessors"].push_back(std::move(accessor));
    // Until the numbers are written, the longest text that bounds can have stands in their place.
    constexpr float longest = std::numeric_limits<float>::lowest();
    if (bounded) setBounds(index + p, meshopt_ ? bounds[p] : Bounds{glm::vec3(longest), glm::vec3(longest)});
  }
  return index;
}

GltfBuilder::Place GltfBuilder::addPacked(const ElementType& element, const Fill& fill, MeshoptFilter filter,
                                          std::vector<Bounds>* bounds) {
  const std::size_t count = gaussians_.size();
  std::vector<std::uint8_t> bytes(count * element.stride());
  std::vector<GaussianBlocks::Scratch> scratch(static_cast<std::size_t>(threadCount()));
  parallelForWorkers(
      static_cast<std::int64_t>((count + kBlock - 1) / kBlock), 8, std::ssize(scratch),
      [&](std::int64_t block, int worker) {
        const std::size_t first = static_cast<std::size_t>(block) * kBlock;
        fill(gaussians_.block(first, std::min(kBlock, count - first), scratch[static_cast<std::size_t>(worker)]),
             bytes.data() + first * element.stride());
      });
  if (filter.kind == MeshoptFilter::Kind::fixed) roundToSteps(bytes, filter.exponent);
  if (bounds) addBounds(*bounds, 0, bytes);
  FilteredView filtered = filterForMeshopt(std::move(bytes), element.stride(), filter);
  const auto open = std::ranges::find_if(open_views_, [&](const OpenView& view) {
    return view.stride == filtered.stride && view.filter == filtered.filter;
  });
  if (open != open_views_.end()) {
    const Place place{open->view, open->elements.size(), open->stride};
    open->elements.insert(open->elements.end(), filtered.bytes.begin(), filtered.bytes.end());
    return place;
  }
  Json& views = document["bufferViews"];
  views.push_back(nullptr);
  open_views_.push_back({views.size() - 1, filtered.stride, filtered.filter, std::move(filtered.bytes)});
  const Place place{open_views_.back().view, 0, open_views_.back().stride};
  if (count > kFewGaussians) packViews();
  return place;
}

void GltfBuilder::packViews() {
  for (const OpenView& open : open_views_) {
    std::vector<std::uint8_t> packed = packMeshopt(open.elements, open.stride);
    const std::uint64_t size = packed.size();
    const std::uint64_t offset = reserve(size);
    Json& view = document["bufferViews"][open.view];
    view = {{"buffer", 1},
            {"byteOffset", unpacked_bytes_},
            {"byteLength", open.elements.size()},
            {"byteStride", open.stride},
            {"target", kArrayBuffer}};
    view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                     {"byteOffset", offset},
                                                     {"byteLength", size},
                                                     {"byteStride", open.stride},
                                                     {"count", open.elements.size() / open.stride},
                                                     {"mode", "ATTRIBUTES"},
                                                     {"filter", open.filter}};
    unpacked_bytes_ += open.elements.size();
    addBlob(std::move(packed), offset);
  }
  open_views_.clear();
}

std::uint64_t GltfBuilder::binaryBytes() const {
  std::uint64_t bytes = binary_bytes_;
  for (const OpenView& open : open_views_) bytes += open.elements.size();
  return bytes;
}

std::size_t GltfBuilder::addImage(std::vector<std::uint8_t> file, const std::string& mime_type,
                                  const std::string& name) {
  packViews();  // images are the last thing in the buffer
  const std::uint64_t size = file.size();
  const std::uint64_t offset = reserve(size);
  const std::size_t view = addView(offset, size);
  addBlob(std::move(file), offset);
  document["images"].push_back({{"name", name}, {"mimeType", mime_type}, {"bufferView", view}});
  blobs_.back().file_name = "_" + name + "." + mime_type.substr(mime_type.find('/') + 1);
  if (mime_type == "image/x-exr") blobs_.back().file_name = "_" + name + ".exr";
  blobs_.back().view = view;
  blobs_.back().image = document["images"].size() - 1;
  return blobs_.back().image;
}

void GltfBuilder::writeBinary(const FileWriter& file, std::uint64_t base, bool with_images) {
  struct Worker {
    GaussianBlocks::Scratch gaussians;
    std::vector<std::vector<std::uint8_t>> bytes;  // of every attribute
    std::vector<std::vector<Bounds>> bounds;       // likewise, of every primitive
  };
  std::vector<Worker> workers(static_cast<std::size_t>(threadCount()));
  for (Worker& worker : workers) {
    for (const Attribute& attribute : attributes_) worker.bytes.emplace_back(kWrittenBlock * attribute.stride);
    worker.bounds.assign(attributes_.size(), std::vector<Bounds>(ends_.size()));
  }
  const std::size_t size = gaussians_.size();
  const std::size_t blocks = attributes_.empty() ? 0 : (size + kWrittenBlock - 1) / kWrittenBlock;
  parallelForWorkers(static_cast<std::int64_t>(blocks), 1, std::ssize(workers), [&](std::int64_t item, int number) {
    const std::size_t first = static_cast<std::size_t>(item) * kWrittenBlock;
    const std::size_t count = std::min(kWrittenBlock, size - first);
    Worker& worker = workers[static_cast<std::size_t>(number)];
    for (std::size_t done = 0; done < count; done += kBlock) {
      const std::size_t part = std::min(kBlock, count - done);
      const GaussianBlocks::Block block = gaussians_.block(first + done, part, worker.gaussians);
      for (std::size_t k = 0; k < attributes_.size(); ++k) {
        attributes_[k].fill(block, worker.bytes[k].data() + done * attributes_[k].stride);
      }
    }
    for (std::size_t k = 0; k < attributes_.size(); ++k) {
      const Attribute& attribute = attributes_[k];
      const std::span<const std::uint8_t> bytes = std::span(worker.bytes[k]).first(count * attribute.stride);
      if (attribute.bounded) addBounds(worker.bounds[k], first, bytes);
      file.write(base + attribute.offset + std::uint64_t{first} * attribute.stride, bytes);
    }
  });
  for (std::size_t k = 0; k < attributes_.size(); ++k) {
    if (!attributes_[k].bounded) continue;
    for (std::size_t p = 0; p < ends_.size(); ++p) {
      Bounds all;
      for (const Worker& worker : workers) all.add(worker.bounds[k][p]);
      setBounds(attributes_[k].accessor + p, all);
    }
  }
  for (const Blob& blob : blobs_) {
    if (blob.file_name.empty() || with_images) file.write(base + blob.offset, blob.bytes);
  }
}

Json GltfBuilder::buffers(Json first) const {
  Json buffers = Json::array({std::move(first)});
  if (meshopt_) {
    Json fallback = {{"byteLength", unpacked_bytes_}};
    fallback["extensions"]["EXT_meshopt_compression"]["fallback"] = true;
    buffers.push_back(std::move(fallback));
  }
  return buffers;
}

std::uint64_t GltfBuilder::writeGlb(const std::filesystem::path& path) {
  packViews();
  document["buffers"] = buffers({{"byteLength", binary_bytes_}});
  // Bounds are known once the numbers behind this text have been written, and are no longer than the ones in it now.
  const std::uint64_t text_bytes = aligned(textOf(document).size());
  const std::uint64_t binary = aligned(binary_bytes_);
  const std::uint64_t head_bytes = kGlbHeaderBytes + 2 * kChunkHeaderBytes + text_bytes;
  const std::uint64_t total = head_bytes + binary;
  if (total > kMaxGlbBytes) {
    throw Error(ErrorKind::badData, path.string(),
                "the model does not fit a GLB (expected at most 4 GiB, found " + std::to_string(total) +
                    " bytes; a .gltf has no limit)");
  }
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    const FileWriter file(temporary, path);
    file.resize(total);
    writeBinary(file, head_bytes, true);
    std::string text = textOf(document);
    text.resize(static_cast<std::size_t>(text_bytes), ' ');
    file.write(0, glbHead(text, binary));
  });
  return total;
}

std::uint64_t GltfBuilder::writeGltf(const std::filesystem::path& path, bool replace) {
  packViews();
  const std::string stem = path.stem().string();
  const std::filesystem::path folder = path.parent_path();
  std::uint64_t total = 0;
  AtomicFiles files(replace);
  // Images leave the buffer: it ends before the first of them, as they are added last.
  std::uint64_t bytes = binary_bytes_;
  std::vector<std::size_t> dropped;
  for (const Blob& blob : blobs_) {
    if (blob.file_name.empty()) continue;
    bytes = std::min(bytes, blob.offset);
    const std::string name = stem + blob.file_name;
    files.add(folder / name, blob.bytes);
    total += blob.bytes.size();
    Json& image = document["images"][blob.image];
    image.erase("bufferView");
    image["uri"] = uriOf(name);
    dropped.push_back(blob.view);
  }
  for (auto view = dropped.rbegin(); view != dropped.rend(); ++view) {
    document["bufferViews"].erase(document["bufferViews"].begin() + static_cast<std::ptrdiff_t>(*view));
  }
  const std::filesystem::path binary = folder / (stem + ".bin");
  files.add(binary, [&](const std::filesystem::path& temporary) {
    const FileWriter file(temporary, binary);
    file.resize(bytes);
    writeBinary(file, 0, false);
  });
  document["buffers"] = buffers({{"uri", uriOf(stem + ".bin")}, {"byteLength", bytes}});
  const std::string text = document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  files.add(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  files.commit();
  return total + bytes + text.size();
}

}  // namespace tg

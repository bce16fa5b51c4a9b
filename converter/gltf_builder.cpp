// SPDX-License-Identifier: Apache-2.0
// A glTF file under construction.
#include "converter/gltf_builder.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "converter/meshopt.h"
#include "core/error.h"
#include "core/file.h"
#include "core/parallel.h"

namespace tg {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kMaxGlbBytes = 0xFFFFFFFFull;  // the header's 32 bits
constexpr std::size_t kBlock = 4096;                   // elements: a block of all SH of degree 3 fits a core's cache
constexpr int kArrayBuffer = 34962;
constexpr std::uint32_t kMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;

std::uint64_t aligned(std::uint64_t bytes) { return (bytes + 3) / 4 * 4; }

class OpenFile {
 public:
  OpenFile(const std::filesystem::path& file, const std::string& path)
      : descriptor_(::open(file.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC)), path_(path) {
    if (descriptor_ < 0) fail();
  }
  ~OpenFile() { ::close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  int descriptor() const { return descriptor_; }
  [[noreturn]] void fail() const {
    throw Error(ErrorKind::cannotWrite, path_, "cannot be written: " + std::generic_category().message(errno));
  }

 private:
  const int descriptor_;
  const std::string path_;
};

void put(int file, std::span<const std::uint8_t> bytes, std::uint64_t at, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file, bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) {
      throw Error(ErrorKind::cannotWrite, path, "cannot be written: " + std::generic_category().message(errno));
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    at += static_cast<std::uint64_t>(written);
  }
}

void putU32(std::vector<std::uint8_t>& to, std::uint64_t value) {
  for (int shift = 0; shift < 32; shift += 8) to.push_back(static_cast<std::uint8_t>(value >> shift));
}

// A file's name as a relative URI (RFC 3986).
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

std::string textOf(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

GltfBuilder::GltfBuilder(bool meshopt) : meshopt_(meshopt) {
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

std::size_t GltfBuilder::addAttribute(const ElementType& element, std::size_t count, Fill fill, MeshoptFilter filter) {
  count_ = count;
  ElementType stored = element;
  if (meshopt_) {
    if (filter.kind == MeshoptFilter::Kind::quaternion) stored = {element.type, 5122, true, 8};
    addPacked(element, count, fill, filter);
  } else {
    const std::uint64_t bytes = std::uint64_t{count} * element.stride();
    const std::uint64_t offset = reserve(bytes);
    addView(offset, bytes);
    Json& view = document["bufferViews"].back();
    if (element.stride() != element.bytes) view["byteStride"] = element.stride();
    view["target"] = kArrayBuffer;
    attributes_.push_back({offset, element.stride(), std::move(fill)});
  }
  Json accessor = {{"bufferView", document["bufferViews"].size() - 1}, {"componentType", stored.component_type}};
  if (stored.normalized) accessor["normalized"] = true;
  accessor["count"] = count;
  accessor["type"] = stored.type;
  document["accessors"].push_back(std::move(accessor));
  return document["accessors"].size() - 1;
}

void GltfBuilder::addPacked(const ElementType& element, std::size_t count, const Fill& fill,
                            const MeshoptFilter& filter) {
  std::vector<std::uint8_t> bytes(count * element.stride());
  parallelFor(static_cast<std::int64_t>((count + kBlock - 1) / kBlock), 1, [&](std::int64_t block) {
    const std::size_t first = static_cast<std::size_t>(block) * kBlock;
    fill(first, std::min(kBlock, count - first), bytes.data() + first * element.stride());
  });
  PackedView packed = packMeshopt(bytes, count, element.stride(), filter);
  const char* filters[] = {"NONE", "QUATERNION", "EXPONENTIAL"};
  const std::uint64_t size = packed.bytes.size();
  const std::uint64_t offset = reserve(size);
  const std::uint64_t unpacked = std::uint64_t{count} * packed.stride;
  Json view = {{"buffer", 1},
               {"byteOffset", unpacked_bytes_},
               {"byteLength", unpacked},
               {"byteStride", packed.stride},
               {"target", kArrayBuffer}};
  view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                   {"byteOffset", offset},
                                                   {"byteLength", size},
                                                   {"byteStride", packed.stride},
                                                   {"count", count},
                                                   {"mode", "ATTRIBUTES"},
                                                   {"filter", filters[static_cast<int>(filter.kind)]}};
  unpacked_bytes_ += unpacked;
  document["bufferViews"].push_back(std::move(view));
  addBlob(std::move(packed.bytes), offset);
}

std::size_t GltfBuilder::addImage(std::vector<std::uint8_t> file, const std::string& mime_type,
                                  const std::string& name) {
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

void GltfBuilder::writeBinary(int file, std::uint64_t base, bool with_images, const std::string& path) const {
  std::vector<std::vector<std::uint8_t>> scratch(static_cast<std::size_t>(threadCount()));
  parallelForWorkers(static_cast<std::int64_t>((count_ + kBlock - 1) / kBlock), 1, [&](std::int64_t block, int worker) {
    const std::size_t first = static_cast<std::size_t>(block) * kBlock;
    const std::size_t count = std::min(kBlock, count_ - first);
    std::vector<std::uint8_t>& bytes = scratch[static_cast<std::size_t>(worker)];
    for (const Attribute& attribute : attributes_) {
      bytes.assign(count * attribute.stride, 0);
      attribute.fill(first, count, bytes.data());
      put(file, bytes, base + attribute.offset + std::uint64_t{first} * attribute.stride, path);
    }
  });
  for (const Blob& blob : blobs_) {
    if (blob.file_name.empty() || with_images) put(file, blob.bytes, base + blob.offset, path);
  }
}

std::uint64_t GltfBuilder::writeGlb(const std::filesystem::path& path) {
  Json buffers = Json::array({{{"byteLength", binary_bytes_}}});
  if (meshopt_) {
    Json fallback = {{"byteLength", unpacked_bytes_}};
    fallback["extensions"]["EXT_meshopt_compression"]["fallback"] = true;
    buffers.push_back(std::move(fallback));
  }
  document["buffers"] = std::move(buffers);
  std::string text = textOf(document);
  text.resize(aligned(text.size()), ' ');
  const std::uint64_t binary = aligned(binary_bytes_);
  const std::uint64_t total = 12 + 8 + text.size() + 8 + binary;
  if (total > kMaxGlbBytes) {
    throw Error(ErrorKind::badData, path.string(),
                "the model does not fit a GLB (expected at most 4 GiB, found " + std::to_string(total) +
                    " bytes; a .gltf has no limit)");
  }
  std::vector<std::uint8_t> head;
  putU32(head, kMagic);
  putU32(head, 2);
  putU32(head, total);
  putU32(head, text.size());
  putU32(head, kJsonChunk);
  head.insert(head.end(), text.begin(), text.end());
  putU32(head, binary);
  putU32(head, kBinChunk);
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    const OpenFile file(temporary, path.string());
    if (::ftruncate(file.descriptor(), static_cast<off_t>(total)) != 0) file.fail();
    put(file.descriptor(), head, 0, path.string());
    writeBinary(file.descriptor(), head.size(), true, path.string());
  });
  return total;
}

std::uint64_t GltfBuilder::writeGltf(const std::filesystem::path& path) {
  const std::string stem = path.stem().string();
  const std::filesystem::path folder = path.parent_path();
  Json changed = document;
  std::uint64_t total = 0;
  // Images leave the buffer: it ends before the first of them, as they are added last.
  std::uint64_t bytes = binary_bytes_;
  std::vector<std::size_t> dropped;
  for (const Blob& blob : blobs_) {
    if (blob.file_name.empty()) continue;
    bytes = std::min(bytes, blob.offset);
    const std::string name = stem + blob.file_name;
    writeFileAtomically(folder / name, blob.bytes);
    total += blob.bytes.size();
    Json& image = changed["images"][blob.image];
    image.erase("bufferView");
    image["uri"] = uriOf(name);
    dropped.push_back(blob.view);
  }
  for (auto view = dropped.rbegin(); view != dropped.rend(); ++view) {
    changed["bufferViews"].erase(changed["bufferViews"].begin() + static_cast<std::ptrdiff_t>(*view));
  }
  const std::filesystem::path binary = folder / (stem + ".bin");
  writeFileAtomically(binary, [&](const std::filesystem::path& temporary) {
    const OpenFile file(temporary, binary.string());
    if (::ftruncate(file.descriptor(), static_cast<off_t>(bytes)) != 0) file.fail();
    writeBinary(file.descriptor(), 0, false, binary.string());
  });
  changed["buffers"] = Json::array({{{"uri", uriOf(stem + ".bin")}, {"byteLength", bytes}}});
  if (meshopt_) {
    Json fallback = {{"byteLength", unpacked_bytes_}};
    fallback["extensions"]["EXT_meshopt_compression"]["fallback"] = true;
    changed["buffers"].push_back(std::move(fallback));
  }
  const std::string text = changed.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  writeFileAtomically(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  return total + bytes + text.size();
}

}  // namespace tg

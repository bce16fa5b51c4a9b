// SPDX-License-Identifier: Apache-2.0
// A GLB file taken apart, so that tests can look at it and spoil it.
#pragma once
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

struct Glb {
  nlohmann::json json;
  std::string bin;

  static std::string slurp(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }
  static std::uint32_t u32(const std::string& bytes, std::size_t at) {
    std::uint32_t value;
    std::memcpy(&value, bytes.data() + at, sizeof(value));
    return value;
  }

  // A file that is known to be well-formed.
  static Glb read(const std::filesystem::path& path) {
    const std::string bytes = slurp(path);
    const std::uint32_t json_bytes = u32(bytes, 12);
    Glb glb;
    glb.json = nlohmann::json::parse(bytes.substr(20, json_bytes));
    glb.bin = bytes.substr(28 + json_bytes);
    return glb;
  }

  std::string bytes() const {
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string padded = bin;
    padded.resize((padded.size() + 3) / 4 * 4, '\0');
    std::string out = "glTF";
    const auto append = [&](std::uint32_t value) { out.append(reinterpret_cast<const char*>(&value), 4); };
    append(2);
    append(static_cast<std::uint32_t>(12 + 8 + text.size() + (padded.empty() ? 0 : 8 + padded.size())));
    append(static_cast<std::uint32_t>(text.size()));
    append(0x4E4F534A);
    out += text;
    if (!padded.empty()) {
      append(static_cast<std::uint32_t>(padded.size()));
      append(0x004E4942);
      out += padded;
    }
    return out;
  }

  nlohmann::json& primitive() { return json["meshes"][0]["primitives"][0]; }
  nlohmann::json& splatting() { return primitive()["extensions"]["KHR_gaussian_splatting"]; }
  nlohmann::json& textures() { return splatting()["extensions"]["TG_gaussian_splatting_texture"]; }
  nlohmann::json& accessor(const std::string& semantic) {
    return json["accessors"][primitive()["attributes"][semantic].get<int>()];
  }
  nlohmann::json& view(const std::string& semantic) {
    return json["bufferViews"][accessor(semantic)["bufferView"].get<int>()];
  }
  // Where an attribute's first element lies in `bin`.
  std::size_t start(const std::string& semantic) { return view(semantic).value("byteOffset", std::size_t{0}); }

  // Makes `semantic` another accessor on new data.
  template <typename T>
  void setAttribute(const std::string& semantic, const std::vector<T>& values, int component_type,
                    const std::string& type, bool normalized, std::size_t count) {
    bin.resize((bin.size() + 3) / 4 * 4, '\0');
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}});
    bin.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", component_type},
                                 {"type", type},
                                 {"normalized", normalized},
                                 {"count", count}});
    primitive()["attributes"][semantic] = json["accessors"].size() - 1;
    json["buffers"][0]["byteLength"] = bin.size();
  }
  template <typename T>
  std::vector<T> values(const std::string& semantic, std::size_t components) {
    std::vector<T> out(accessor(semantic)["count"].get<std::size_t>() * components);
    const std::size_t element = components * sizeof(T);
    const std::size_t stride = view(semantic).value("byteStride", element);
    for (std::size_t i = 0; i * components < out.size(); ++i) {
      std::memcpy(out.data() + i * components, bin.data() + start(semantic) + i * stride, element);
    }
    return out;
  }
};

// SPDX-License-Identifier: Apache-2.0
// Reads .ksplat.
#include "converter/formats/read_ksplat.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/gtc/packing.hpp>
#include <vector>

#include "converter/formats/little_endian.h"
#include "converter/formats/repair.h"
#include "core/bundle/ply.h"
#include "core/file/file.h"
#include "core/model/verbs.h"
#include "core/system/error.h"
#include "shared/limits.h"

namespace tg {
namespace {

using KsplatBytes = std::span<const std::uint8_t>;

constexpr std::size_t kKsplatHeaderBytes = 4096;
constexpr std::size_t kKsplatSectionBytes = 1024;  // of a section's header; all of them follow the file's
constexpr std::size_t kKsplatBucketBytes = 12;     // its centre
constexpr std::size_t kKsplatLengthBytes = 4;      // of a bucket that is not full
constexpr unsigned kKsplatMaxLevel = 2;
constexpr unsigned kKsplatMaxDegree = 2;
constexpr std::uint32_t kKsplatScaleRange = 32767;  // where a section does not say it
constexpr float kKsplatShRange = 1.5f;              // likewise of the file: bytes span +- this
constexpr std::uint64_t kMaxKsplatBytes = kMaxGaussians * (44 + 24 * 4 + kKsplatBucketBytes + kKsplatLengthBytes);

unsigned readU16(KsplatBytes bytes, std::size_t at) { return bytes[at] | unsigned{bytes[at + 1]} << 8; }
float readF32(KsplatBytes bytes, std::size_t at) { return std::bit_cast<float>(readU32(bytes, at)); }

// Where the numbers of a splat lie in its bytes, by level; its mean is in front.
struct SplatLayout {
  std::size_t scale, rotation, color, sh;
  std::size_t sh_bytes;  // of a coefficient
};
constexpr std::array<SplatLayout, kKsplatMaxLevel + 1> kLayouts = {
    {{12, 24, 40, 44, 4}, {6, 12, 20, 24, 2}, {6, 12, 20, 24, 1}}};

struct KsplatSection {
  std::uint64_t splats = 0;
  unsigned sh_degree = 0;
  std::uint64_t bucket_size = 0;  // splats of a full bucket; these come first
  std::uint64_t full_buckets = 0, partial_buckets = 0;
  double step = 0.0;              // [world units] of a coordinate, from level 1 on
  std::uint32_t scale_range = 0;  // the code of a coordinate at its bucket's centre
  std::size_t lengths_at = 0, buckets_at = 0, splats_at = 0;
  std::size_t splat_bytes = 0;
};

class KsplatParser {
 public:
  KsplatParser(KsplatBytes bytes, const std::string& path) : bytes_(bytes), path_(path) {}

  Bundle parse() {
    readHeader();
    unsigned sh_degree = 0;
    std::size_t at = kKsplatHeaderBytes + sections_.size() * kKsplatSectionBytes;
    std::uint64_t splats = 0;
    for (std::size_t s = 0; s < sections_.size(); ++s) {
      sections_[s] = readSection(s, at);
      if (sections_[s].splats > 0) sh_degree = std::max(sh_degree, sections_[s].sh_degree);
      splats += sections_[s].splats;
    }
    if (splats != splats_) fail("the sections hold another number of splats" + expectedFound(splats_, splats));
    if (at != bytes_.size()) fail(std::to_string(bytes_.size() - at) + " bytes follow the splats (expected none)");
    resizeGaussians(loaded_.model, splats_, static_cast<int>(sh_degree));
    for (const KsplatSection& section : sections_) addSplats(section);
    resizeGaussians(loaded_.model, done_, static_cast<int>(sh_degree));
    repair_.report(loaded_.repairs);
    if (done_ == 0) throw Error(ErrorKind::badData, path_, "no splat is left: none had finite values");
    return std::move(loaded_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw Error(ErrorKind::badData, path_, ".ksplat: " + what); }

  void readHeader() {
    if (bytes_.size() < kKsplatHeaderBytes) {
      fail("the file ends inside the header" +
           expectedFound("at least " + std::to_string(kKsplatHeaderBytes) + " bytes", std::to_string(bytes_.size())));
    }
    if (bytes_[0] != 0 || bytes_[1] != 1) {
      fail("version " + std::to_string(bytes_[0]) + "." + std::to_string(bytes_[1]) +
           " is not supported (expected 0.1)");
    }
    const std::uint64_t sections = readU32(bytes_, 4);
    splats_ = readU32(bytes_, 12);
    level_ = readU16(bytes_, 20);
    if (level_ > kKsplatMaxLevel) fail("wrong compression level" + atMost(kKsplatMaxLevel, level_));
    if (splats_ == 0 || splats_ > kMaxGaussians) {
      fail("wrong number of splats" + expectedFound("1 to " + std::to_string(kMaxGaussians), std::to_string(splats_)));
    }
    const std::uint64_t room = (bytes_.size() - kKsplatHeaderBytes) / kKsplatSectionBytes;
    if (sections > room) fail("too many sections for the file" + atMost(room, sections));
    sections_.resize(sections);
    sh_low_ = readF32(bytes_, 36);
    sh_high_ = readF32(bytes_, 40);
    if (!std::isfinite(sh_low_) || !std::isfinite(sh_high_)) fail("the range of SH is not finite");
    if (sh_low_ == 0.0f) sh_low_ = -kKsplatShRange;
    if (sh_high_ == 0.0f) sh_high_ = kKsplatShRange;
  }

  // Moves `at` from the section's first byte behind its last.
  KsplatSection readSection(std::size_t index, std::size_t& at) const {
    const KsplatBytes header = bytes_.subspan(kKsplatHeaderBytes + index * kKsplatSectionBytes, kKsplatSectionBytes);
    const std::string name = "section " + std::to_string(index) + ": ";
    KsplatSection section;
    section.splats = readU32(header, 4);
    section.sh_degree = readU16(header, 40);
    if (section.sh_degree > kKsplatMaxDegree) {
      fail(name + "wrong SH degree" + atMost(kKsplatMaxDegree, section.sh_degree));
    }
    section.splat_bytes =
        kLayouts[level_].sh + 3 * (shCountOf(static_cast<int>(section.sh_degree)) - 1) * kLayouts[level_].sh_bytes;
    section.lengths_at = at;
    if (level_ > 0) readBuckets(section, header, name);
    section.buckets_at = at + section.partial_buckets * kKsplatLengthBytes;
    const std::uint64_t buckets = section.full_buckets + section.partial_buckets;
    section.splats_at = section.buckets_at + buckets * kKsplatBucketBytes;
    const std::uint64_t end = section.splats_at + section.splats * section.splat_bytes;
    if (end > bytes_.size()) {
      fail(name + "the file is too short for " + std::to_string(section.splats) + " splats in " +
           std::to_string(buckets) + " buckets (expected at least " + std::to_string(end) + " bytes, found " +
           std::to_string(bytes_.size()) + ")");
    }
    if (level_ > 0) checkLengths(section, name);
    at = end;
    return section;
  }

  void readBuckets(KsplatSection& section, KsplatBytes header, const std::string& name) const {
    section.bucket_size = readU32(header, 8);
    section.full_buckets = readU32(header, 32);
    section.partial_buckets = readU32(header, 36);
    const std::uint64_t buckets = readU32(header, 12), bucket_bytes = readU16(header, 20);
    if (buckets != section.full_buckets + section.partial_buckets) {
      fail(name + "full and other buckets are not all" +
           expectedFound(buckets, section.full_buckets + section.partial_buckets));
    }
    if (buckets == 0) return;  // of no splats, as checkLengths() will have it
    if (bucket_bytes != kKsplatBucketBytes) {
      fail(name + "wrong size of a bucket" + expectedFound(kKsplatBucketBytes, bucket_bytes));
    }
    const float block = readF32(header, 16);
    if (!std::isfinite(block)) fail(name + "the size of a block is not finite");
    section.scale_range = readU32(header, 24);
    if (section.scale_range == 0) section.scale_range = kKsplatScaleRange;
    section.step = 0.5 * static_cast<double>(block) / section.scale_range;
  }

  // Of buckets that lie inside the file.
  void checkLengths(const KsplatSection& section, const std::string& name) const {
    std::uint64_t held = section.full_buckets * section.bucket_size;
    for (std::uint64_t b = 0; b < section.partial_buckets; ++b) held += lengthOf(section, b);
    if (held != section.splats) {
      fail(name + "the buckets hold another number of splats" + expectedFound(section.splats, held));
    }
  }
  std::uint32_t lengthOf(const KsplatSection& section, std::uint64_t partial) const {
    return readU32(bytes_, section.lengths_at + partial * kKsplatLengthBytes);
  }

  void addSplats(const KsplatSection& section) {
    std::uint64_t bucket = 0, left = 0;  // splats of it
    const auto enter = [&] {
      left = bucket < section.full_buckets ? section.bucket_size : lengthOf(section, bucket - section.full_buckets);
    };
    if (level_ > 0 && section.splats > 0) enter();
    for (std::uint64_t i = 0; i < section.splats; ++i) {
      glm::vec3 center(0.0f);
      if (level_ > 0) {
        while (left == 0) {  // ends: the lengths add up to the splats
          ++bucket;
          enter();
        }
        --left;
        for (int k = 0; k < 3; ++k) {
          center[k] =
              readF32(bytes_, section.buckets_at + bucket * kKsplatBucketBytes + 4 * static_cast<std::size_t>(k));
        }
      }
      addSplat(section, bytes_.subspan(section.splats_at + i * section.splat_bytes, section.splat_bytes), center);
    }
  }

  // The k-th float or half from `at` on.
  float number(KsplatBytes splat, std::size_t at, std::size_t k) const {
    if (level_ == 0) return readF32(splat, at + 4 * k);
    return glm::unpackHalf1x16(static_cast<glm::uint16>(readU16(splat, at + 2 * k)));
  }

  void addSplat(const KsplatSection& section, KsplatBytes bytes, glm::vec3 center) {
    const SplatLayout& layout = kLayouts[level_];
    GaussianModel& model = loaded_.model;
    LinearSplat splat;
    splat.mean = level_ == 0 ? glm::vec3(number(bytes, 0, 0), number(bytes, 0, 1), number(bytes, 0, 2))
                             : placed(section, bytes, center);
    for (std::size_t k = 0; k < 3; ++k) splat.scale[static_cast<int>(k)] = number(bytes, layout.scale, k);
    for (std::size_t k = 0; k < 4; ++k) splat.rotation[static_cast<int>(k)] = number(bytes, layout.rotation, k);

    glm::vec3* sh = model.sh.data() + done_ * model.shCount();
    std::fill_n(sh, model.shCount(), glm::vec3(0.0f));
    for (std::size_t c = 0; c < 3; ++c) {
      sh[0][static_cast<int>(c)] = (static_cast<float>(bytes[layout.color + c]) / 255.0f - 0.5f) / kShC0;
    }
    bool finite = true;
    std::size_t stored = 0;  // degree by degree, in each red before green before blue
    for (int degree = 1; degree <= static_cast<int>(section.sh_degree); ++degree) {
      for (int c = 0; c < 3; ++c) {
        for (std::size_t k = shCountOf(degree - 1); k < shCountOf(degree); ++k) {
          sh[k][c] = coefficient(bytes, stored++);
          finite = finite && std::isfinite(sh[k][c]);
        }
      }
    }
    if (!repair_.mend(splat, finite)) return;
    model.mean[done_] = splat.mean;
    model.rotation[done_] = splat.rotation;
    model.log_scale[done_] = logFromScale(splat.scale);
    model.opacity_logit[done_++] = logitFromOpacity(bytes[layout.color + 3] / 255.0);
  }

  // From level 1 on: the mean of a splat in a bucket around `center`.
  static glm::vec3 placed(const KsplatSection& section, KsplatBytes splat, glm::vec3 center) {
    const glm::dvec3 codes(readU16(splat, 0), readU16(splat, 2), readU16(splat, 4));
    return glm::dvec3(center) + (codes - static_cast<double>(section.scale_range)) * section.step;
  }

  float coefficient(KsplatBytes splat, std::size_t k) const {
    if (level_ < 2) return number(splat, kLayouts[level_].sh, k);
    return sh_low_ + static_cast<float>(splat[kLayouts[level_].sh + k]) / 255.0f * (sh_high_ - sh_low_);
  }

  const KsplatBytes bytes_;
  const std::string& path_;
  std::vector<KsplatSection> sections_;
  std::uint64_t splats_ = 0;
  unsigned level_ = 0;
  float sh_low_ = 0.0f, sh_high_ = 0.0f;  // what bytes of SH span
  Bundle loaded_;
  std::size_t done_ = 0;  // Gaussians
  LinearRepair repair_;
};

}  // namespace

Bundle parseKsplat(std::span<const std::uint8_t> bytes, const std::string& path) {
  return KsplatParser(bytes, path).parse();
}

Bundle readKsplat(const std::filesystem::path& path) {
  return parseKsplat(readFile(path, kMaxKsplatBytes), path.string());
}

}  // namespace tg

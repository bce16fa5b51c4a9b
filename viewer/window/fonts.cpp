// SPDX-License-Identifier: Apache-2.0
// Fonts of the system, by fontconfig where that is there.
#include "viewer/window/fonts.h"

#include <imgui.h>
#include <imgui_internal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#ifdef TG_FONTCONFIG
#include <fontconfig/fontconfig.h>
#endif

#include "core/file/file.h"

namespace tg {
namespace {

constexpr float kFontSize = 14.0f;          // [px] at scale 1
constexpr unsigned kFirstWanted = 0x100;    // letters below are always there
constexpr std::size_t kMostLetters = 3000;  // beyond them: the atlas stays within what every device takes
constexpr std::size_t kMostFonts = 12;
constexpr float kOthersSize = 1.2f;  // sizes are those of lines, which are higher where letters are

// The built-in font is a 13 px bitmap; a system's sans serif reads better and scales. Missing: the built-in one.
constexpr std::array kFonts = {
    "/usr/share/fonts/truetype/noto/NotoSans-Regular.ttf",
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
    "/usr/share/fonts/truetype/liberation/LiberationSans-Regular.ttf",
    "/usr/share/fonts/truetype/ubuntu/Ubuntu-R.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf",
    "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
};

// What the built fonts read their ranges from; lives until the atlas is built.
using Ranges = ImVector<ImWchar>;

Ranges rangesOf(const std::set<unsigned>& letters, bool latin) {
  ImFontGlyphRangesBuilder builder;
  if (latin) builder.AddRanges(ImGui::GetIO().Fonts->GetGlyphRangesDefault());
  for (const unsigned letter : letters) builder.AddChar(static_cast<ImWchar>(letter));
  Ranges ranges;
  builder.BuildRanges(&ranges);
  return ranges;
}

#ifdef TG_FONTCONFIG

struct FontFile {
  std::string path;
  int index = 0;               // in a collection
  std::set<unsigned> letters;  // that are taken of it
};

template <typename T, void (*kDestroy)(T*)>
struct Destroy {
  void operator()(T* value) const { kDestroy(value); }
};
using Pattern = std::unique_ptr<FcPattern, Destroy<FcPattern, FcPatternDestroy>>;
using CharSet = std::unique_ptr<FcCharSet, Destroy<FcCharSet, FcCharSetDestroy>>;
using FontSet = std::unique_ptr<FcFontSet, Destroy<FcFontSet, FcFontSetDestroy>>;

// The system's fonts, best first, that have those letters between them.
std::vector<FontFile> fontsFor(std::set<unsigned> letters) {
  std::vector<FontFile> files;
  const Pattern pattern(FcPatternCreate());
  const CharSet wanted(FcCharSetCreate());
  for (const unsigned letter : letters) FcCharSetAddChar(wanted.get(), letter);
  FcPatternAddCharSet(pattern.get(), FC_CHARSET, wanted.get());
  FcPatternAddString(pattern.get(), FC_FAMILY, reinterpret_cast<const FcChar8*>("sans-serif"));
  FcPatternAddBool(pattern.get(), FC_SCALABLE, FcTrue);
  FcConfigSubstitute(nullptr, pattern.get(), FcMatchPattern);
  FcDefaultSubstitute(pattern.get());
  FcResult result = FcResultMatch;
  const FontSet sorted(FcFontSort(nullptr, pattern.get(), FcTrue, nullptr, &result));
  for (int i = 0; sorted && i < sorted->nfont && !letters.empty() && files.size() < kMostFonts; ++i) {
    FcChar8 *path = nullptr, *format = nullptr;
    FcCharSet* has = nullptr;
    FontFile file;
    FcPatternGetInteger(sorted->fonts[i], FC_INDEX, 0, &file.index);
    if (FcPatternGetString(sorted->fonts[i], FC_FILE, 0, &path) != FcResultMatch ||
        FcPatternGetString(sorted->fonts[i], FC_FONTFORMAT, 0, &format) != FcResultMatch ||
        FcPatternGetCharSet(sorted->fonts[i], FC_CHARSET, 0, &has) != FcResultMatch) {
      continue;
    }
    file.path = reinterpret_cast<const char*>(path);
    file.index &= 0xffff;  // above: which instance of a variable font
    const std::string_view kind = reinterpret_cast<const char*>(format);
    if ((kind != "TrueType" && kind != "CFF") || !isFile(file.path)) continue;
    for (const unsigned letter : letters) {
      if (FcCharSetHasChar(has, letter)) file.letters.insert(letter);
    }
    if (file.letters.empty()) continue;
    for (const unsigned letter : file.letters) letters.erase(letter);
    files.push_back(std::move(file));
  }
  return files;
}

#endif

}  // namespace

void Fonts::want(std::string_view text) {
  const char *at = text.data(), *end = at + text.size();
  while (at < end) {
    if (static_cast<unsigned char>(*at) < 0x80) {
      ++at;
      continue;
    }
    unsigned letter = 0;
    at += std::max(ImTextCharFromUtf8(&letter, at, end), 1);
    if (letter < kFirstWanted || letter > IM_UNICODE_CODEPOINT_MAX || letter == IM_UNICODE_CODEPOINT_INVALID) continue;
    if (wanted_.size() < kMostLetters && wanted_.insert(letter).second) stale_ = true;
  }
}

void Fonts::load() {
  stale_ = false;
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.Clear();
  const float size = std::round(kFontSize * scale_);
  const Ranges own = rangesOf(wanted_, true);
  const auto file = std::find_if(kFonts.begin(), kFonts.end(), isFile);
  ImFontConfig config;
  if (file == kFonts.end() || !atlas.AddFontFromFileTTF(*file, size, nullptr, own.Data)) {
    config.SizePixels = std::round(13.0f * scale_);
    atlas.AddFontDefault(&config);
  }
#ifdef TG_FONTCONFIG
  std::vector<Ranges> ranges;
  const std::vector<FontFile> files = wanted_.empty() ? std::vector<FontFile>() : fontsFor(wanted_);
  ranges.reserve(files.size());  // the atlas points into it
  for (const FontFile& other : files) {
    ImFontConfig merged;
    merged.MergeMode = true;
    merged.FontNo = other.index;
    ranges.push_back(rangesOf(other.letters, false));
    atlas.AddFontFromFileTTF(other.path.c_str(), std::round(kOthersSize * size), &merged, ranges.back().Data);
  }
#endif
  atlas.Build();
}

}  // namespace tg

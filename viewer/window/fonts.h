// SPDX-License-Identifier: Apache-2.0
// The letters that the panels are written in: Dear ImGui 1.86 draws only those that its atlas was made with, so names
// of files bring theirs with them.
#pragma once
#include <set>
#include <string_view>

namespace tg {

class Fonts {
 public:
  explicit Fonts(float scale) : scale_(scale) {}

  // Asks for the letters of a UTF-8 text. Broken bytes and what lies beyond U+FFFF are no letters.
  void want(std::string_view text);
  // Letters were asked for since load().
  bool stale() const { return stale_; }
  // Fills the atlas of Dear ImGui's context, which the back end then uploads: the interface's font, and of the system's
  // other fonts what letters that one lacks. Letters that no font has stay question marks.
  void load();

 private:
  float scale_;
  std::set<unsigned> wanted_;
  bool stale_ = true;
};

}  // namespace tg

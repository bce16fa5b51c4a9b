// SPDX-License-Identifier: Apache-2.0
// Part of a program that has a namespace of its own with the name of the library's inner one, and names in it that are
// there, too: neither may be taken for the other. What both have of the standard library may be there twice.
#include <filesystem>
#include <memory>
#include <regex>
#include <string>
#include <vector>

namespace tg {

struct Camera {
  int x;
};
std::vector<Camera> cameras(int count) {
  std::vector<Camera> made;
  for (int i = 0; i < count; ++i) made.push_back({i});
  made.resize(2 * made.size());
  return std::vector<Camera>(made);
}
int threadCount() { return static_cast<int>(cameras(7).size()); }
bool isNamed(const std::string& text) {
  const auto number = std::make_shared<std::string>(std::to_string(threadCount()));
  return std::regex_match(text, std::regex("[[:alpha:]]+" + *number)) && std::filesystem::exists(text);
}

}  // namespace tg

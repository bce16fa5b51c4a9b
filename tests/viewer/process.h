// SPDX-License-Identifier: Apache-2.0
// Runs tgview as a user does, in a folder of its own with a small model in it.
#pragma once
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/image/image.h"
#include "core/model/model.h"
#include "support/temporary_folder.h"

namespace tg::test {

struct ProcessResult {
  int exit_code = -1;  // 128 + signal when killed by one
  std::string out;
  std::string err;
};

// A folder that is gone at the end of a test.
class Workshop {
 public:
  // Runs `prefix` (a wrapper or env, as words) and tgview with `arguments` inside the folder, without any display
  // unless the prefix brings one. `program`: tgview, or tgview_under_test, whose scripts have verbs that make it fail.
  ProcessResult tgview(const std::vector<std::string>& arguments, const std::vector<std::string>& prefix = {},
                       const char* program = TG_TGVIEW) const;
  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  void write(const std::string& name, std::string_view bytes) const;
  Image read(const std::string& name) const { return readImage(folder_ / name); }

 private:
  TemporaryFolder folder_;
};

// Textured, with three cameras of 96 x 72 of which number 1 is a test view, and a white background.
GaussianModel sampleModel(int gaussians = 400);
void writeSample(const std::filesystem::path& path, int gaussians = 400, const std::string& training_json = "");

// Those of "vulkan" and "opengl" that have a device; says why the others have none.
std::vector<std::string> deviceBackends();
// For TG_SKIP_IF: why none of them has one, "" when one has.
std::string noDevice();
// The backend that a test of windows runs on: what the environment names as TG_TEST_BACKEND, else `usual`.
std::string backendOr(const std::string& usual);
// For TG_SKIP_IF: why no window can be opened on that backend, "" when one can.
std::string noWindow(const std::string& backend = backendOr("vulkan"));

// The prefix of Workshop::tgview() that gives it a screen.
inline const std::vector<std::string> kXServer = {"xvfb-run", "-a", "-s", "-screen 0 1024x768x24"};

}  // namespace tg::test

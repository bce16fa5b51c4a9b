// SPDX-License-Identifier: Apache-2.0
// Runs tgview and collects what it says.
#include "viewer/process.h"

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "core/bundle/bundle.h"
#include "core/system/error.h"
#include "render/devices/devices.h"
#include "support/scenes.h"

namespace tg::test {
namespace {

std::string quoted(const std::string& word) {
  std::string result("'");
  for (char c : word) {
    if (c == '\'') result.append("'\\'");
    result.push_back(c);
  }
  result.push_back('\'');
  return result;
}

std::string contents(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

ProcessResult Workshop::tgview(const std::vector<std::string>& arguments, const std::vector<std::string>& prefix,
                               const char* program) const {
  std::ostringstream command;
  command << "cd " << quoted(folder_.path.string()) << " && env -u DISPLAY -u WAYLAND_DISPLAY";
  for (const std::string& word : prefix) command << ' ' << quoted(word);
  command << ' ' << quoted(program);
  for (const std::string& word : arguments) command << ' ' << quoted(word);
  command << " >.out 2>.err";
  const int status = std::system(command.str().c_str());
  ProcessResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = contents(folder_ / ".out");
  result.err = contents(folder_ / ".err");
  return result;
}

void Workshop::write(const std::string& name, std::string_view bytes) const {
  std::ofstream(folder_ / name, std::ios::binary) << bytes;
}

GaussianModel sampleModel(int gaussians) { return trainedLikeModel(11, gaussians); }

void writeSample(const std::filesystem::path& path, int gaussians, const std::string& training_json) {
  Bundle bundle;
  bundle.model = sampleModel(gaussians);
  bundle.training_json = training_json;
  bundle.background = glm::vec3(1.0f);
  const Camera seen = trainedLikeCamera(96, 72);
  for (int i = 0; i < 3; ++i) {
    Camera camera = seen;
    camera.name = "view" + std::to_string(i) + ".png";
    camera.translation.x += 0.1 * i;
    camera.test = i == 1;
    bundle.cameras.push_back(camera);
  }
  writeBundle(path, bundle);
}

std::vector<std::string> deviceBackends() {
  std::vector<std::string> names;
  for (const Api api : kApis) {
    try {
      openDevice(api, {});
      names.emplace_back(name(api));
    } catch (const Error& error) {
      std::cout << "left out: " << error.what() << "\n";
    }
  }
  return names;
}

std::string noDevice() { return deviceBackends().empty() ? "no device of Vulkan or OpenGL" : ""; }

std::string backendOr(const std::string& usual) {
  const char* named = std::getenv("TG_TEST_BACKEND");
  return named ? named : usual;
}

std::string noWindow(const std::string& backend) {
  if (std::system("command -v xvfb-run >/dev/null 2>&1") != 0) return "no xvfb-run (packages xvfb, xauth)";
  const std::vector<std::string> names = deviceBackends();
  return std::find(names.begin(), names.end(), backend) != names.end() ? "" : "no device of " + backend;
}

}  // namespace tg::test

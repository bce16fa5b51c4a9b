// SPDX-License-Identifier: Apache-2.0
// Runs tgview below driver.sh.
#include "viewer/window/hand.h"

#include <cstdlib>
#include <filesystem>

#include "support/catch.h"

namespace tg::test {

std::string noHand() {
  if (std::string why = noWindow(); !why.empty()) return why;
  // `command -v` of several succeeds where the first of them is there.
  const char* all = "command -v xdotool >/dev/null && command -v openbox >/dev/null && command -v import >/dev/null";
  if (std::system(all) == 0) return "";
  return "no xdotool, openbox or import (packages xdotool, openbox, imagemagick)";
}

void playByHand(const Workshop& shop, const std::string& script, const std::string& hand,
                std::vector<std::string> models, const char* program) {
  std::filesystem::copy(TG_DRIVER, shop / "driver.sh");
  shop.write("hand.sh", hand);
  shop.write("script.txt", "panel off\nwait 3\nwindow ready.png\n" + script);
  models.insert(models.end(),
                {"--script", "script.txt", "--size", "640x480", "--backend", backendOr("cpu"), "--validation"});
  std::vector<std::string> prefix = kXServer;
  prefix.insert(prefix.end(), {"sh", "driver.sh"});
  const ProcessResult result = shop.tgview(models, prefix, program);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
}

std::string seen(const std::string& name) { return "await-file " + name + "\nwindow " + name + ".png\n"; }

}  // namespace tg::test

// SPDX-License-Identifier: Apache-2.0
// Options as a table, and the name that was meant.
#include "core/system/command_table.h"

#include <algorithm>
#include <ctime>
#include <string>
#include <vector>

#include "core/system/error.h"
#include "core/system/nearest_name.h"
#include "core/system/program.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("a slip of a letter or two is the nearest name, what is far from all is none") {
  const std::vector<std::string> names = {"--textures", "--turntable", "--render", "check"};
  CHECK(nearestName("--textrues", names) == "--textures");
  CHECK(nearestName("--rendr", names) == "--render");
  CHECK(nearestName("chekc", names) == "check");
  CHECK(nearestName("--turn", names) == "--turntable");  // its beginning
  CHECK(nearestName("--quality", names).empty());
  CHECK(nearestName("", names).empty());
}

TEST_CASE("a text that is far longer than all names is near none at once") {
  const std::vector<std::string> names = {"--textures", "--turntable", "--render", "check"};
  const std::string text(100'000'000, 'x');
  const std::clock_t before = std::clock();
  CHECK(nearestName(text, names).empty());
  CHECK(std::clock() - before < CLOCKS_PER_SEC);  // comparing all of them takes 20 times as long
}

TEST_CASE("an option's row knows its value, its choices, its range and its default") {
  CLI::App app("Does things.", "tool");
  std::string name = "fast";
  int count = 3;
  bool flag = false;
  std::vector<std::string> files;
  app.add_option("files", files, "what to read")->required()->type_name("FILE");
  app.add_option("--mode", name, "how")->check(oneOf({"fast", "exact"}))->capture_default_str();
  app.add_option("-n,--count", count, "how often")->check(within(1, 9))->capture_default_str();
  app.add_flag("--dry-run", flag, "write nothing");
  app.add_option("--serve", name, "where")->type_name("[ADDRESS:]PORT");
  std::uint64_t bytes = 0;
  addBytes(app, "--size", bytes, "how large");
  const CommandTable table = tableOf(app);
  const auto row = [&](const std::string& wanted) {
    return *std::ranges::find_if(table.options, [&](const OptionRow& option) { return option.names.back() == wanted; });
  };
  CHECK(row("files").argument);
  CHECK(row("files").many);
  CHECK(titleOf(row("files")) == "files...");
  CHECK(row("--mode").choices == std::vector<std::string>{"fast", "exact"});
  CHECK(meaningOf(row("--mode")) == "how (fast or exact; default: fast)");
  CHECK(titleOf(row("--count")) == "-n, --count N");
  CHECK(meaningOf(row("--count")) == "how often (1 to 9; default: 3)");
  CHECK(row("--dry-run").value.empty());
  CHECK(titleOf(row("--serve")) == "    --serve [ADDRESS:]PORT");
  CHECK(titleOf(row("--size")) == "    --size SIZE");
  CHECK(meaningOf(row("--size")) == "how large");
  for (const auto& [text, expected] :
       std::initializer_list<std::pair<std::string, std::uint64_t>>{{"1500", 1500},
                                                                    {"900KB", 900'000},
                                                                    {"1.5 mb", 1'500'000},
                                                                    {"2GB", 2'000'000'000},
                                                                    {"7B", 7},
                                                                    {"1.5MiB", 1'572'864},
                                                                    {"2kib", 2048},
                                                                    {"3TB", 3'000'000'000'000},
                                                                    {"1GiB", 1'073'741'824}}) {
    app.parse("--size '" + text + "' files");
    CHECK(bytes == expected);
  }
  CHECK(usageOf(table) == "tool [OPTIONS] files...");
  CHECK_THROWS_AS(formatCompletion(table, "csh"), Error);
}

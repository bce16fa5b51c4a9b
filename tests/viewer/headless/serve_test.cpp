// SPDX-License-Identifier: Apache-2.0
// tgview --serve, asked as a browser does.
#include <cstdlib>

#include "support/catch.h"
#include "viewer/process.h"

using namespace tg;
using test::Workshop;

TEST_CASE("a page shows a model that is written again, and goes on with it where the next one is broken") {
  TG_SKIP_IF(std::system("curl --version >/dev/null 2>&1") == 0 ? "" : "no curl");
  const Workshop shop;
  test::writeSample(shop / "a.tgz", 20);
  test::writeSample(shop / "b.tgz", 30);
  shop.write("c.tgz", "no model");
  // Each line waits for a minute at most.
  shop.write("ask.sh", R"(
    "$@" >log 2>&1 & page=$!
    soon() { for _ in $(seq 1200); do eval "$1" && return; sleep 0.05; done; cat log; kill $page; exit 1; }
    shows() { curl -s --max-time 5 "$(sed -n 's/^serving //p' log)state.json" | grep -q "\"model\":$1[,}]"; }
    soon "grep -q '^serving ' log"
    soon "shows 1"
    mv b.tgz a.tgz; soon "shows 2"
    mv c.tgz a.tgz; soon "grep -q 'a.tgz: ' log"
    shows 2 && kill $page && wait $page)");
  const test::ProcessResult result = shop.tgview({"a.tgz", "--serve", "0"}, {"bash", "ask.sh"});
  INFO(result.out);
  INFO(result.err);
  CHECK(result.exit_code == 0);
}

// SPDX-License-Identifier: Apache-2.0
// Catch2 version 2 (Debian 12) or 3 (Ubuntu 24.04, Debian 13), and cases that a machine cannot run.
#pragma once
#include <iostream>
#include <string>

#if __has_include(<catch2/catch_all.hpp>)
#include <catch2/catch_all.hpp>
using Catch::Approx;
// As version 2 names it; version 3 has another matcher of this name.
inline auto Contains(const std::string& text) { return Catch::Matchers::ContainsSubstring(text); }
#else
#include <catch2/catch.hpp>
using Catch::Contains;
#endif

// Ends the case where `why`, a text, is not empty: ctest shows it as skipped, because tests/CMakeLists.txt looks for
// these words. A case asks before it checks anything: ctest looks for the words in failed cases, too.
#define TG_SKIP_IF(why)                                            \
  if (const std::string missing = (why); !missing.empty()) {       \
    std::cout << "this case is skipped: " << missing << std::endl; \
    return;                                                        \
  }

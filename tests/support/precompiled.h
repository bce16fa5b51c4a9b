// SPDX-License-Identifier: Apache-2.0
// What most cases include and no change of ours touches (tests/CMakeLists.txt, tg_precompile).
#pragma once
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "support/catch.h"

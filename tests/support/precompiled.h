// SPDX-License-Identifier: Apache-2.0
// What most cases include and no change of ours touches (tests/CMakeLists.txt, tg_precompile).
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "support/catch.h"

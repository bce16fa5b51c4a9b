// SPDX-License-Identifier: Apache-2.0
// The devices of all APIs as one list.
#include "core/system/error.h"
#include "render/devices/devices.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("every device in the list says what it can do or why it cannot be used") {
  const std::vector<DeviceInfo> devices = listDevices();
  REQUIRE(devices.size() >= 2);  // of each API one, or a line that says why there is none
  for (const DeviceInfo& device : devices) {
    INFO(device.api << ", " << device.limits.device << ", " << device.missing);
    if (!device.missing.empty()) continue;
    CHECK_FALSE(device.limits.device.empty());
    CHECK_FALSE(device.version.empty());
    CHECK(device.limits.storage_bytes >= 1u << 24);
    CHECK(device.limits.texel_elements >= 65536);
    CHECK(device.limits.image_side >= 1024);
  }
}

TEST_CASE("a number picks that device, and nothing but a number is one") {
  const std::vector<DeviceInfo> devices = listDevices();
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DevicePick pick = pickDevice(std::to_string(i));
    REQUIRE(pick.api.has_value());
    CHECK((*pick.api == Api::vulkan) == (devices[i].api == "Vulkan"));
    INFO(i << ": " << devices[i].missing);
    if (devices[i].missing.empty()) {
      const auto opened = openDevice(*pick.api, {pick, false});
      CHECK(opened->makeRenderer()->deviceName() == devices[i].limits.device);
      CHECK(opened->software() == devices[i].software);
    } else {
      CHECK_THROWS_AS(openDevice(*pick.api, {pick, false}), Error);
    }
  }
  CHECK_THROWS_WITH(pickDevice(std::to_string(devices.size())),
                    Contains("--device: expected a name or 0 to " + std::to_string(devices.size() - 1)));
  CHECK(pickDevice("").any());
  CHECK(pickDevice("9 lives").name == "9 lives");
  CHECK_FALSE(pickDevice("llvm").any());
}

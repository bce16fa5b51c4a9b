// SPDX-License-Identifier: Apache-2.0
// What only OpenGL needs: constants in GLSL text, errors of contexts and drivers.
#include <epoxy/gl.h>

#include "core/system/error.h"
#include "gpu_device.h"
#include "render/gl/gl_device.h"
#include "render/gl/shader_text.h"
#include "render/gpu/shaders.h"
#include "support/catch.h"

using namespace tg;
using namespace tg::test;

TEST_CASE("constants replace what GLSL text declares, and others keep their values") {
  const std::string text =
      "layout(local_size_x_id = 1)in;\nlayout(constant_id = 0)const bool kA = true;\n"
      "layout(constant_id = 2) const uint kB = 2u;\nlayout(constant_id = 3)const uint kC = kD;\nlayout(binding = 3)x;";
  CHECK(specialized(text, std::vector<std::uint32_t>{0, 64, 4}) ==
        "layout(local_size_x = 64) in;\nconst bool kA = bool(0u);\nconst uint kB = uint(4u);\n"
        "const uint kC = kD;\nlayout(binding = 3)x;");
  CHECK(specialized("", {}) == "");
}

TEST_CASE("the text of every pass is plain GLSL 4.50 without anything left to resolve") {
  for (unsigned i = 0; i <= static_cast<unsigned>(Shader::present); ++i) {
    const ShaderModule& module = moduleOf(static_cast<Shader>(i));
    const std::string text = module.text;
    INFO(module.name);
    CHECK(text.substr(0, 12) == "#version 450");
    CHECK(text.find('#', 1) == std::string::npos);
    CHECK(text.find("[[") == std::string::npos);
    CHECK(specialized(text, {}).find("_id =") == std::string::npos);
  }
}

TEST_CASE("an error of OpenGL is thrown with its name and what was being done, once") {
  gpuRenderer();  // makes its context current
  GlDevice device;
  device.limits.device = "a device";
  glBindBuffer(GL_ARRAY_BUFFER, 12345);  // names must come from glGenBuffers
  CHECK(validationMessages() != "");
  CHECK_THROWS_WITH(checkGl(device, "a test"), Catch::Contains("a device: OpenGL: invalid operation (1282) in a test"));
  CHECK_NOTHROW(checkGl(device, "a test"));
}

TEST_CASE("a buffer that the device has no memory for is an error that names it and its size") {
  const std::unique_ptr<GpuDevice> device = makePassDevice();
  CHECK_THROWS_WITH(device->makeBuffer("the moon", std::uint64_t{1} << 50),
                    Catch::Contains("no memory for the moon (1073741824 MiB)"));
  validationMessages();  // it says so, too
}

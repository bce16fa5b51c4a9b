// SPDX-License-Identifier: Apache-2.0
// What only OpenGL needs: constants in GLSL text, errors of contexts and drivers.
#include <epoxy/gl.h>

#include <map>
#include <utility>

#include "core/system/error.h"
#include "gpu_device.h"
#include "render/gl/gl_device.h"
#include "render/gl/shader_text.h"
#include "render/gpu/shaders.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

// What a driver is made to say of itself while this lives.
class ClaimedLimits {
 public:
  explicit ClaimedLimits(std::map<GLenum, GLint> limits) {
    claimed_ = std::move(limits);
    real_ = std::exchange(epoxy_glGetIntegerv, [](GLenum name, GLint* value) {
      const auto found = claimed_.find(name);
      found == claimed_.end() ? real_(name, value) : void(*value = found->second);
    });
    real64_ = std::exchange(epoxy_glGetInteger64v, [](GLenum name, GLint64* value) {
      const auto found = claimed_.find(name);
      found == claimed_.end() ? real64_(name, value) : void(*value = found->second);
    });
  }
  ~ClaimedLimits() {
    epoxy_glGetIntegerv = real_;
    epoxy_glGetInteger64v = real64_;
  }
  GLint& operator[](GLenum name) { return claimed_[name]; }

 private:
  static inline std::map<GLenum, GLint> claimed_;
  static inline PFNGLGETINTEGERVPROC real_;
  static inline PFNGLGETINTEGER64VPROC real64_;
};

// The least that OpenGL 4.5 lets a driver have (chapter 23) of what a pass, a buffer or an image asks for.
const std::map<GLenum, GLint> kLeastLimits = {
    {GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS, 8}, {GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, 8},
    {GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS, 16},   {GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS, 1024},
    {GL_MAX_COMPUTE_SHARED_MEMORY_SIZE, 32768}, {GL_MAX_SHADER_STORAGE_BLOCK_SIZE, 1 << 27},
    {GL_MAX_TEXTURE_BUFFER_SIZE, 65536},        {GL_MAX_TEXTURE_SIZE, 16384}};

}  // namespace

TEST_CASE("with OpenGL's least limits only bindings of storage buffers lack, and models are drawn as far as they fit") {
  GpuRenderer& renderer = gpuRenderer();  // makes its context current
  ClaimedLimits claimed(kLeastLimits);
  CHECK(whatIsMissing() == "11 bindings of storage buffers (it has 8)");
  claimed[GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS] = 11;
  CHECK(whatIsMissing() == "");
  for (const auto& [limit, lacking, what] :
       {std::tuple{GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, 6, "7 storage buffers in a compute shader (it has 6)"},
        std::tuple{GL_MAX_COMPUTE_TEXTURE_IMAGE_UNITS, 5, "6 textures in a compute shader (it has 5)"},
        std::tuple{GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS, 255, "256 threads in a group (it has 255)"},
        std::tuple{GL_MAX_COMPUTE_SHARED_MEMORY_SIZE, 20479, "20480 bytes of shared memory (it has 20479)"}}) {
    const GLint least = std::exchange(claimed[static_cast<GLenum>(limit)], lacking);
    CHECK(whatIsMissing() == what);
    claimed[static_cast<GLenum>(limit)] = least;
  }

  GlDevice described;
  describeContext(described, {});
  CHECK(described.limits.storage_bytes == 1u << 27);
  CHECK(described.limits.texel_elements == 65536);
  CHECK(described.limits.image_side == 16384);
  const TestScene fits = makeScene(SceneKind::ordinary, 11, 1500, 96, 64);
  const auto draw = [&](const GaussianModel& model) {
    renderer.setModel(model);
    return renderer.render(fits.camera, {});
  };
  const Frame whole = draw(fits.model);
  const Bindings own = claim({described.limits.storage_bytes, described.limits.texel_elements});
  const Frame found = draw(fits.model);
  CHECK_THROWS_WITH(draw(makeScene(SceneKind::ordinary, 11, 60000).model), Contains("the device binds at most"));
  claim(own);
  CHECK(found.base == whole.base);
  CHECK(found.texture == whole.texture);
  CHECK(validationMessages() == "");
}

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
  CHECK_THROWS_WITH(checkGl(device, "a test"), Contains("a device: OpenGL: invalid operation (1282) in a test"));
  CHECK_NOTHROW(checkGl(device, "a test"));
}

TEST_CASE("a buffer that the device has no memory for is an error that names it and its size") {
  const std::unique_ptr<GpuDevice> device = makePassDevice();
  CHECK_THROWS_WITH(device->makeBuffer("the moon", std::uint64_t{1} << 50),
                    Contains("no memory for the moon (1073741824 MiB)"));
  CHECK_THROWS_AS(device->makeBuffer("the moon", std::uint64_t{1} << 50), DoesNotFit);
  validationMessages();  // it says so, too
}

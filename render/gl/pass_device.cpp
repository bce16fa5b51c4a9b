// SPDX-License-Identifier: Apache-2.0
// Memory, programs and the execution of pass lists.
#include "render/gl/pass_device.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <string>

#include "core/system/assert.h"
#include "core/system/error.h"
#include "render/gl/shader_text.h"

namespace tg {
namespace {

constexpr std::uint64_t kStagingBytes = std::uint64_t{16} << 20;

std::uint64_t roundUp(std::uint64_t value, std::uint64_t step) { return (value + step - 1) / step * step; }

const GlBuffer& glBuffer(const GpuBuffer& buffer) { return static_cast<const GlBuffer&>(buffer); }

struct TexelFormat {
  GLenum internal;
  std::uint32_t bytes;
};

constexpr TexelFormat kTexelFormats[] = {
    {}, {GL_R32UI, 4}, {GL_RGBA32UI, 16}, {GL_RGBA32F, 16}, {GL_RGBA16F, 8}};  // as Texels
static_assert(std::size(kTexelFormats) == static_cast<std::size_t>(Texels::rgba16f) + 1);

std::string logOf(GLuint object, decltype(glGetProgramiv) parameters, decltype(glGetProgramInfoLog) log) {
  GLint length = 0;
  parameters(object, GL_INFO_LOG_LENGTH, &length);
  std::string text(static_cast<std::size_t>(std::max(length, 1)), '\0');
  log(object, length, nullptr, text.data());
  return text.c_str();
}

[[noreturn]] void refuseShader(const GlDevice& device, Shader shader, const std::string& log) {
  throw Error(ErrorKind::device, device.limits.device, std::string("pass ") + moduleOf(shader).name + ": " + log);
}

GLuint compileShader(const GlDevice& device, Shader which, std::span<const std::uint32_t> constants) {
  const ShaderModule& module = moduleOf(which);
  const GLuint shader = glCreateShader(GL_COMPUTE_SHADER);
  if (device.spirv) {
    std::vector<GLuint> ids(constants.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<GLuint>(i);
    glShaderBinary(1, &shader, GL_SHADER_BINARY_FORMAT_SPIR_V_ARB, module.code.data(),
                   static_cast<GLsizei>(module.code.size_bytes()));
    glSpecializeShaderARB(shader, "main", static_cast<GLuint>(ids.size()), ids.data(), constants.data());
  } else {
    const std::string text = specialized(module.text, constants);
    const char* source = text.c_str();
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
  }
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled) return shader;
  const std::string log = logOf(shader, glGetShaderiv, glGetShaderInfoLog);
  glDeleteShader(shader);
  refuseShader(device, which, log);
}

// What a shader may read, be it as data, as texels or as the arguments of a dispatch, and what a copy may write.
constexpr GLbitfield kWritten = GL_SHADER_STORAGE_BARRIER_BIT | GL_TEXTURE_FETCH_BARRIER_BIT | GL_COMMAND_BARRIER_BIT |
                                GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT |
                                GL_TEXTURE_UPDATE_BARRIER_BIT;

}  // namespace

GlBuffer::GlBuffer(const GlDevice& device, const char* name, std::uint64_t bytes)
    : device_(device), label_(name), size_(bufferBytes(bytes)) {
  glCreateBuffers(1, &buffer_);
  glNamedBufferStorage(buffer_, static_cast<GLsizeiptr>(allocatedBytes(size_)), nullptr, GL_DYNAMIC_STORAGE_BIT);
  if (device_.debug) glObjectLabel(GL_BUFFER, buffer_, -1, name);
  const GLenum error = glGetError();
  if (error == GL_NO_ERROR) return;
  glDeleteBuffers(1, &buffer_);
  if (error == GL_OUT_OF_MEMORY) {
    throw DoesNotFit(ErrorKind::device, device_.limits.device,
                     "no memory for " + std::string(name) + " (" + std::to_string(size_ >> 20) + " MiB)");
  }
  throw Error(ErrorKind::device, device_.limits.device,
              "cannot make the buffer of " + std::string(name) + " (error " + std::to_string(error) + ")");
}

GlBuffer::~GlBuffer() {
  for (const auto& [format, texture] : textures_) glDeleteTextures(1, &texture);
  glDeleteBuffers(1, &buffer_);
}

GLuint GlBuffer::texture(Texels format) const {
  for (const auto& [known, texture] : textures_) {
    if (known == format) return texture;
  }
  const TexelFormat& texels = kTexelFormats[static_cast<std::size_t>(format)];
  if (size_ / texels.bytes > device_.limits.texel_elements) {
    throw Error(ErrorKind::device, device_.limits.device,
                std::string(label_) + ": " + std::to_string(size_ / texels.bytes) + " elements (expected at most " +
                    std::to_string(device_.limits.texel_elements) + ")");
  }
  GLuint texture = 0;
  glCreateTextures(GL_TEXTURE_BUFFER, 1, &texture);
  glTextureBuffer(texture, texels.internal, buffer_);
  try {
    checkGl(device_, label_);
    textures_.emplace_back(format, texture);
  } catch (...) {  // without storage it would be empty in each frame to come
    glDeleteTextures(1, &texture);
    throw;
  }
  return texture;
}

GlReadBack::~GlReadBack() { glDeleteBuffers(1, &staging_); }

void GlReadBack::read(GLuint buffer, std::span<std::byte> out) {
  if (staging_ == 0) {
    glCreateBuffers(1, &staging_);
    glNamedBufferStorage(staging_, static_cast<GLsizeiptr>(kStagingBytes), nullptr,
                         GL_MAP_READ_BIT | GL_CLIENT_STORAGE_BIT);
    try {
      checkGl(device_, "reading back");
    } catch (...) {  // without storage it would fail each frame to come
      glDeleteBuffers(1, &staging_);
      staging_ = 0;
      throw;
    }
    if (device_.debug) glObjectLabel(GL_BUFFER, staging_, -1, "read-back");
  }
  for (std::size_t first = 0; first < out.size(); first += kStagingBytes) {
    const auto length = static_cast<GLsizeiptr>(std::min<std::size_t>(kStagingBytes, out.size() - first));
    glCopyNamedBufferSubData(buffer, staging_, static_cast<GLintptr>(first), 0, length);
    glGetNamedBufferSubData(staging_, 0, length, out.data() + first);
  }
}

GlImage::GlImage(const GlDevice& device, std::uint32_t width, std::uint32_t height) {
  glCreateTextures(GL_TEXTURE_2D, 1, &texture_);
  glTextureStorage2D(texture_, 1, GL_RGBA8, static_cast<GLsizei>(width), static_cast<GLsizei>(height));
  try {
    checkGl(device, "the picture");
  } catch (...) {
    glDeleteTextures(1, &texture_);
    throw;
  }
}

GlImage::~GlImage() { glDeleteTextures(1, &texture_); }

GlPrograms::~GlPrograms() {
  for (const auto& [key, program] : programs_) glDeleteProgram(program);
}

GLuint GlPrograms::get(Shader shader, std::span<const std::uint32_t> constants) {
  const auto [entry, is_new] = programs_.try_emplace({shader, {constants.begin(), constants.end()}}, 0);
  GLuint& program = entry->second;
  if (program) return program;
  const GLuint compiled = compileShader(device_, shader, constants);
  program = glCreateProgram();
  glAttachShader(program, compiled);
  glLinkProgram(program);
  glDetachShader(program, compiled);
  glDeleteShader(compiled);
  GLint linked = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &linked);
  if (linked) return program;
  const std::string log = logOf(program, glGetProgramiv, glGetProgramInfoLog);
  glDeleteProgram(program);
  program = 0;
  refuseShader(device_, shader, log);
}

GlTimer::~GlTimer() { glDeleteQueries(static_cast<GLsizei>(queries_.size()), queries_.data()); }

void GlTimer::begin() {
  names_.clear();
  clock_.clear();
  stamps_ = 0;
  stamp();
}

void GlTimer::mark(const char* name) {
  names_.push_back(name);
  stamp();
}

void GlTimer::stamp() {
  if (!device_.time_stamps) {
    glFinish();
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    clock_.push_back(std::chrono::duration<double, std::milli>(now).count());
    return;
  }
  if (stamps_ == queries_.size()) glCreateQueries(GL_TIMESTAMP, 1, &queries_.emplace_back());
  glQueryCounter(queries_[stamps_++], GL_TIMESTAMP);
}

std::vector<PassTime> GlTimer::read() const {
  std::vector<double> at = clock_;  // [ms]
  for (std::size_t i = 0; i < stamps_; ++i) {
    GLuint64 nanoseconds = 0;
    glGetQueryObjectui64v(queries_[i], GL_QUERY_RESULT, &nanoseconds);
    at.push_back(static_cast<double>(nanoseconds) * 1e-6);
  }
  std::vector<PassTime> times;
  for (std::size_t i = 0; i < names_.size(); ++i) times.push_back({names_[i], at[i + 1] - at[i]});
  return times;
}

GlProgram::GlProgram(const GlDevice& device, GlPrograms& programs, GlReadBack& read_back, const PassList& list)
    : device_(device),
      read_back_(read_back),
      timer_(device),
      first_(list.firstCounters()),
      counters_(glBuffer(*list.counters()).name()),
      view_(device, "view uniforms", sizeof(ViewUniforms)),
      slots_(device, "pass uniforms", list.passes().size() * roundUp(sizeof(PassUniforms), device.uniform_alignment)) {
  const std::uint64_t stride = roundUp(sizeof(PassUniforms), device.uniform_alignment);
  std::vector<std::byte> slots(slots_.size());
  for (const GpuBuffer* buffer : list.cleared()) cleared_.push_back(glBuffer(*buffer).name());
  for (const Pass& pass : list.passes()) {
    Dispatch dispatch{};
    dispatch.name = pass.name;
    dispatch.program = programs.get(pass.shader, pass.options.constants);
    dispatch.groups = pass.groups;
    if (pass.options.image) dispatch.image = static_cast<const GlImage*>(pass.options.image)->name();
    auto binding = static_cast<GLuint>(moduleOf(pass.shader).image);
    for (const Binding& bound : pass.buffers) {
      const GlBuffer& buffer = glBuffer(*bound.buffer);
      if (bound.texels != Texels::none) {
        dispatch.textures.emplace_back(binding, buffer.texture(bound.texels));
      } else {
        dispatch.buffers.push_back({binding, buffer.name(), static_cast<GLintptr>(bound.offset),
                                    static_cast<GLsizeiptr>(bound.bytes ? bound.bytes : buffer.size())});
      }
      ++binding;
    }
    const std::size_t slot = dispatches_.size() * stride;
    dispatch.slot = static_cast<GLintptr>(slot);
    std::memcpy(slots.data() + slot, &pass.uniforms, sizeof pass.uniforms);
    dispatches_.push_back(std::move(dispatch));
  }
  glNamedBufferSubData(slots_.name(), 0, static_cast<GLsizeiptr>(slots.size()), slots.data());
  checkGl(device_, "preparing the passes");
}

void GlProgram::execute(const Dispatch& dispatch) const {
  glUseProgram(dispatch.program);
  for (const auto& [unit, texture] : dispatch.textures) glBindTextureUnit(unit, texture);
  for (const Dispatch::Storage& s : dispatch.buffers) {
    glBindBufferRange(GL_SHADER_STORAGE_BUFFER, s.binding, s.buffer, s.offset, s.bytes);
  }
  if (dispatch.image) glBindImageTexture(0, dispatch.image, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
  glBindBufferRange(GL_UNIFORM_BUFFER, kPassBinding, slots_.name(), dispatch.slot, sizeof(PassUniforms));
  if (dispatch.groups.indirect) {
    glDispatchComputeIndirect(static_cast<GLintptr>(*dispatch.groups.indirect));
  } else {
    const glm::uvec3 count = dispatch.groups.count;
    glDispatchCompute(count.x, count.y, count.z);
  }
}

void GlProgram::run(const ViewUniforms& view) {
  glNamedBufferSubData(view_.name(), 0, sizeof view, &view);
  glNamedBufferSubData(counters_, 0, sizeof first_, &first_);
  for (const GLuint buffer : cleared_) {
    glClearNamedBufferData(buffer, GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, nullptr);
  }
  glBindBufferRange(GL_UNIFORM_BUFFER, kViewBinding, view_.name(), 0, sizeof view);
  glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, counters_);
  timer_.begin();
  for (std::size_t i = 0; i < dispatches_.size(); ++i) {
    execute(dispatches_[i]);
    glMemoryBarrier(kWritten);
    const bool last_of_name =
        i + 1 == dispatches_.size() || std::strcmp(dispatches_[i + 1].name, dispatches_[i].name) != 0;
    if (last_of_name) timer_.mark(dispatches_[i].name);
  }
  read_back_.read(counters_, std::as_writable_bytes(std::span(&last_, 1)));
  checkGl(device_, "drawing a frame");
}

BufferPtr GlPassDevice::makeBuffer(const char* name, std::uint64_t bytes) {
  TG_ASSERT(thread_ == std::this_thread::get_id(), "a context stays in its thread");
  return std::make_unique<GlBuffer>(device_, name, bytes);
}

ImagePtr GlPassDevice::makeImage(std::uint32_t width, std::uint32_t height) {
  const std::uint32_t most = device_.limits.image_side;
  return std::make_unique<GlImage>(device_, allocatedSide(width, most), allocatedSide(height, most));
}

void GlPassDevice::upload(const BufferPtr& target, std::uint64_t bytes, std::uint64_t granularity,
                          const std::function<void(std::uint64_t first, std::span<std::byte>)>& write) {
  TG_ASSERT(thread_ == std::this_thread::get_id(), "a context stays in its thread");
  TG_ASSERT(granularity > 0 && bytes % granularity == 0, "whole grains are uploaded");
  TG_ASSERT(bytes <= glBuffer(*target).size(), "the buffer has room");
  const std::uint64_t piece = std::min(bytes, std::max(kStagingBytes / granularity, std::uint64_t{1}) * granularity);
  std::vector<std::byte> staging(piece);
  for (std::uint64_t first = 0; first < bytes; first += piece) {
    const std::uint64_t length = std::min(piece, bytes - first);
    write(first, {staging.data(), static_cast<std::size_t>(length)});
    glNamedBufferSubData(glBuffer(*target).name(), static_cast<GLintptr>(first), static_cast<GLsizeiptr>(length),
                         staging.data());
  }
  checkGl(device_, "an upload");
}

void GlPassDevice::download(const BufferPtr& source, std::span<std::byte> out) {
  TG_ASSERT(thread_ == std::this_thread::get_id(), "a context stays in its thread");
  TG_ASSERT(out.size() <= glBuffer(*source).size(), "the buffer holds as much");
  if (out.empty()) return;
  read_back_.read(glBuffer(*source).name(), out);
  checkGl(device_, "a read-back");
}

Image GlPassDevice::download(const ImagePtr& source, std::uint32_t width, std::uint32_t height) {
  std::vector<std::byte> pixels(std::size_t{4} * width * height);
  glGetTextureSubImage(static_cast<const GlImage&>(*source).name(), 0, 0, 0, 0, static_cast<GLsizei>(width),
                       static_cast<GLsizei>(height), 1, GL_RGBA, GL_UNSIGNED_BYTE, static_cast<GLsizei>(pixels.size()),
                       pixels.data());
  checkGl(device_, "the picture's read-back");
  return imageFromRgba8(pixels, static_cast<int>(width), static_cast<int>(height));
}

std::unique_ptr<PassProgram> GlPassDevice::prepare(const PassList& list) {
  TG_ASSERT(thread_ == std::this_thread::get_id(), "a context stays in its thread");
  return std::make_unique<GlProgram>(device_, *programs_, read_back_, list);
}

void GlPassDevice::run(PassProgram& program, const ViewUniforms& view) {
  TG_ASSERT(thread_ == std::this_thread::get_id(), "a context stays in its thread");
  static_cast<GlProgram&>(program).run(view);
}

}  // namespace tg

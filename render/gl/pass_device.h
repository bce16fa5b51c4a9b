// SPDX-License-Identifier: Apache-2.0
// Lists of passes on OpenGL: programs, bindings, barriers and times.
#pragma once
#include <epoxy/gl.h>
#include <map>
#include <thread>
#include <utility>
#include <vector>

#include "render/gl/gl_device.h"
#include "render/gpu/passes.h"

namespace tg {

class GlBuffer final : public GpuBuffer {
 public:
  GlBuffer(const GlDevice& device, const char* name, std::uint64_t bytes);
  GlBuffer& operator=(GlBuffer&&) = delete;
  ~GlBuffer() override;

  GLuint name() const { return buffer_; }
  std::uint64_t size() const { return size_; }  // [bytes] of it that passes are shown; more may be allocated
  // As a buffer texture; made at the first call for a format. Throws Error(device) when it has more elements
  // than the device can bind.
  GLuint texture(Texels format) const;

 private:
  const GlDevice& device_;
  const char* label_;
  GLuint buffer_ = 0;
  std::uint64_t size_ = 0;
  mutable std::vector<std::pair<Texels, GLuint>> textures_;
};

// Memory of the host that buffers are read through: drivers may move a buffer that is read itself out of the GPU's
// memory, where every later pass pays for it.
class GlReadBack {
 public:
  explicit GlReadBack(const GlDevice& device) : device_(device) {}
  GlReadBack& operator=(GlReadBack&&) = delete;
  ~GlReadBack();
  // The first bytes of a buffer, after all that was sent before. Leaves errors to checkGl().
  void read(GLuint buffer, std::span<std::byte> out);

 private:
  const GlDevice& device_;
  GLuint staging_ = 0;
};

class GlImage final : public GpuImage {
 public:
  GlImage(const GlDevice& device, std::uint32_t width, std::uint32_t height);
  GlImage& operator=(GlImage&&) = delete;
  ~GlImage() override;
  GLuint name() const { return texture_; }

 private:
  GLuint texture_ = 0;
};

// Programs by shader and specialization constants, each linked at its first use and kept.
class GlPrograms {
 public:
  explicit GlPrograms(const GlDevice& device) : device_(device) {}
  GlPrograms& operator=(GlPrograms&&) = delete;
  ~GlPrograms();
  // constants[i] specializes constant_id i. Throws Error(device) with the driver's log.
  GLuint get(Shader shader, std::span<const std::uint32_t> constants);

 private:
  const GlDevice& device_;
  std::map<std::pair<Shader, std::vector<std::uint32_t>>, GLuint> programs_;
};

// Time per pass name of one run: the device's time stamps, or the host's clock where those cannot be believed, which
// then waits for every row.
class GlTimer {
 public:
  explicit GlTimer(const GlDevice& device) : device_(device) {}
  GlTimer& operator=(GlTimer&&) = delete;
  ~GlTimer();

  void begin();
  void mark(const char* name);  // all since the last mark belongs to `name`
  std::vector<PassTime> read() const;

 private:
  void stamp();

  const GlDevice& device_;
  std::vector<const char*> names_;
  std::vector<double> clock_;    // [ms]
  std::vector<GLuint> queries_;  // one more than there ever were names
  std::size_t stamps_ = 0;
};

class GlProgram final : public PassProgram {
 public:
  // `read_back` must outlive this.
  GlProgram(const GlDevice& device, GlPrograms& programs, GlReadBack& read_back, const PassList& list);
  void run(const ViewUniforms& view);
  Counters counters() const override { return last_; }
  std::vector<PassTime> times() const override { return timer_.read(); }
  void next() override {}

 private:
  struct Dispatch {
    const char* name;
    GLuint program;
    std::vector<std::pair<GLuint, GLuint>> textures;  // unit, texture
    struct Storage {
      GLuint binding;
      GLuint buffer;
      GLintptr offset;
      GLsizeiptr bytes;
    };
    std::vector<Storage> buffers;
    GLuint image;
    GLintptr slot;  // [bytes] of its PassUniforms
    Groups groups;
  };
  void execute(const Dispatch& dispatch) const;

  const GlDevice& device_;
  GlReadBack& read_back_;
  GlTimer timer_;
  Counters first_;
  Counters last_{};
  GLuint counters_;
  std::vector<GLuint> cleared_;
  GlBuffer view_;
  GlBuffer slots_;
  std::vector<Dispatch> dispatches_;
};

class GlPassDevice final : public GpuDevice {
 public:
  // `device` must outlive this.
  GlPassDevice(GlDevice& device, std::shared_ptr<GlPrograms> programs)
      : device_(device), programs_(std::move(programs)), read_back_(device) {}

  GpuLimits limits() const override { return device_.limits; }
  BufferPtr makeBuffer(const char* name, std::uint64_t bytes) override;
  ImagePtr makeImage(std::uint32_t width, std::uint32_t height) override;
  void upload(const BufferPtr& target, std::uint64_t bytes, std::uint64_t granularity,
              const std::function<void(std::uint64_t first, std::span<std::byte>)>& write) override;
  void download(const BufferPtr& source, std::span<std::byte> out) override;
  Image download(const ImagePtr& source, std::uint32_t width, std::uint32_t height) override;
  std::unique_ptr<PassProgram> prepare(const PassList& list) override;
  void run(PassProgram& program, const ViewUniforms& view) override;

 private:
  const std::thread::id thread_ = std::this_thread::get_id();
  GlDevice& device_;
  std::shared_ptr<GlPrograms> programs_;
  GlReadBack read_back_;
};

}  // namespace tg

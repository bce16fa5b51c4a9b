// SPDX-License-Identifier: Apache-2.0
// Where a recording's frames go: numbered pictures, or a video that the ffmpeg program makes of them.
#pragma once
#include <filesystem>
#include <functional>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <thread>

#include "core/image/image.h"
#include "core/system/worker.h"

namespace tg {

struct RecordTarget {
  std::filesystem::path path;  // of a video; of pictures, with one run of # that stands for the frame's number
  bool video = false;
};

// .mp4, .mov, .mkv and .webm are videos; frames/####.png, .jpg and .exr pictures, numbered from 0; a folder, there
// already or without an extension, stands for FOLDER/####.png. Throws Error(usage) for anything else. `has_numbers`:
// whether the recording's pictures may be .exr; those of the window have colours alone.
RecordTarget parseRecordTarget(const std::filesystem::path& path, const std::string& what, bool has_numbers = true);
// The picture of one frame: the number with as many digits as there are #, or more where it needs them.
std::filesystem::path framePath(const RecordTarget& target, std::size_t frame);
// Videos have even sides (their colour is stored at half the size): the next even size, at least 2.
glm::ivec2 recordSize(const RecordTarget& target, glm::ivec2 size);

// Compresses and writes in a thread of its own while the next frame is rendered. A video appears under its name when it
// is whole; pictures appear one by one. Destroyed without finish, it ends the work: a video leaves no file, written
// pictures stay.
class FrameWriter {
 public:
  // Throws at once for a place that cannot be written, where pictures of a longer recording are, which the `frames` of
  // this one would not all replace, or where the ffmpeg program is missing: Error(cannotWrite). `size`: recordSize.
  // `fps` > 0, of a video.
  FrameWriter(RecordTarget target, glm::ivec2 size, double fps, std::size_t frames);

  const RecordTarget& target() const { return target_; }
  bool ready() const { return !frames_.full(); }  // add would not wait
  // The next frame, `size` px with 3 channels (pictures: or 1). Waits while the thread is behind. Throws what stopped
  // the thread: Error(cannotWrite) with ffmpeg's own words.
  void add(Image frame);
  // Once: waits until all is on disk. Throws as add does.
  void finish();

 private:
  using NextFrame = std::function<std::optional<Image>()>;  // none: there are no more
  void writePictures(const NextFrame& next) const;
  void writeVideo(const NextFrame& next) const;

  static constexpr std::size_t kQueuedFrames = 2;  // rendering and compressing overlap; more would only take memory

  const RecordTarget target_;
  const glm::ivec2 size_;
  const double fps_;
  std::string ffmpeg_;  // the program's path
  Queue<Image> frames_{kQueuedFrames};
  std::jthread thread_;
};

// The program of that name that the shell would start; "" when there is none.
std::string findProgram(const std::string& name);

}  // namespace tg

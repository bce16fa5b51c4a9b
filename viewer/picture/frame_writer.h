// SPDX-License-Identifier: Apache-2.0
// Where a recording's frames go: numbered pictures, or a video that the ffmpeg program makes of them.
#pragma once
#include <condition_variable>
#include <deque>
#include <exception>
#include <filesystem>
#include <glm/glm.hpp>
#include <mutex>
#include <string>
#include <thread>

#include "core/image/image.h"

namespace tg {

struct RecordTarget {
  std::filesystem::path path;  // of a video; of pictures, with one run of # that stands for the frame's number
  bool video = false;
};

// .mp4, .mov, .mkv and .webm are videos; frames/####.png, .jpg and .exr pictures, numbered from 0; a folder, there
// already or without an extension, stands for FOLDER/####.png. Throws Error(usage) for anything else.
RecordTarget parseRecordTarget(const std::filesystem::path& path, const std::string& what);
// The picture of one frame: the number with as many digits as there are #, or more where it needs them.
std::filesystem::path framePath(const RecordTarget& target, std::size_t frame);
// Videos have even sides (their colour is stored at half the size): the next even size, at least 2.
glm::ivec2 recordSize(const RecordTarget& target, glm::ivec2 size);

// Compresses and writes in a thread of its own while the next frame is rendered. A video appears under its name when it
// is whole; pictures appear one by one.
class FrameWriter {
 public:
  // Throws at once for a place that cannot be written or where the ffmpeg program is missing: Error(cannotWrite).
  // `size`: recordSize. `fps` > 0, of a video.
  FrameWriter(RecordTarget target, glm::ivec2 size, double fps);
  // Without finish: ends the work. A video leaves no file, written pictures stay.
  ~FrameWriter();
  FrameWriter(const FrameWriter&) = delete;
  FrameWriter& operator=(const FrameWriter&) = delete;

  const RecordTarget& target() const { return target_; }
  bool ready() const;  // add would not wait
  // The next frame, `size` px with 3 channels (pictures: or 1). Waits while the thread is behind. Throws what stopped
  // the thread: Error(cannotWrite) with ffmpeg's own words.
  void add(Image frame);
  // Waits until all is on disk. Throws as add does.
  void finish();

 private:
  void work();
  void writePictures();
  void writeVideo();
  bool take(Image& frame);  // false: there are no more
  void rethrow();           // with the lock held

  const RecordTarget target_;
  const glm::ivec2 size_;
  const double fps_;
  std::string ffmpeg_;  // the program's path

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  std::deque<Image> queue_;
  bool closed_ = false;     // no frame follows
  bool cancelled_ = false;  // nor is what is queued wanted
  bool done_ = false;       // the thread has ended its work
  std::exception_ptr error_;
  std::thread thread_;
};

// The program of that name that the shell would start; "" when there is none.
std::string findProgram(const std::string& name);

}  // namespace tg

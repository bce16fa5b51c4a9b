// SPDX-License-Identifier: Apache-2.0
// Frames to disk. ffmpeg gets raw RGB on its standard input, which is a socket: writing to one whose reader has died
// can be told not to raise SIGPIPE, so that the program's signal handling stays untouched.
#include "viewer/picture/frame_writer.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <sstream>
#include <vector>

#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/system/assert.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"

namespace tg {
namespace {

constexpr std::array kVideoExtensions = {".mp4", ".mov", ".mkv", ".webm"};
constexpr std::array kPictureExtensions = {".png", ".jpg", ".exr"};

// Thrown by the thread itself when the recording is given up.
struct Cancelled {};

template <typename List>
bool contains(const List& list, const std::string& text) {
  return std::find(list.begin(), list.end(), text) != list.end();
}

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, FileCloser>;

[[noreturn]] void failSystem(const std::filesystem::path& path, const std::string& what, int reason) {
  throw Error(ErrorKind::cannotWrite, path.string(), what + ": " + std::strerror(reason));
}

// ffmpeg, taking raw frames of one size. Killed when it is not finished.
class Encoder {
 public:
  Encoder(const std::string& program, const std::filesystem::path& out, const std::filesystem::path& reported,
          glm::ivec2 size, double fps)
      : reported_(reported), messages_(std::tmpfile()) {
    int ends[2];
    if (!messages_ || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
      failSystem(reported, "cannot start ffmpeg", errno);
    }
    input_ = std::make_unique<Descriptor>(ends[0]);
    const Descriptor reader(ends[1]);
    start(program, arguments(out, size, fps), reader.get());
  }

  ~Encoder() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    (void)wait();
  }

  void write(const std::vector<std::uint8_t>& bytes) {
    std::size_t sent = 0;
    while (sent < bytes.size()) {
      const ssize_t got = ::send(input_->get(), bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) fail(wait());  // it has ended: its own words say why
      sent += static_cast<std::size_t>(got);
    }
  }

  void finish() {
    input_->close();
    const int status = wait();
    if (status != 0) fail(status);
  }

 private:
  static std::vector<std::string> arguments(const std::filesystem::path& out, glm::ivec2 size, double fps) {
    char rate[32];
    std::snprintf(rate, sizeof rate, "%.6f", fps);
    // -xerror: without it a video whose end does not fit on the disk is a success.
    std::vector<std::string> words = {"ffmpeg", "-hide_banner", "-loglevel", "error", "-nostdin", "-xerror", "-y",
                                      // What comes in.
                                      "-f", "rawvideo", "-pixel_format", "rgb24", "-video_size",
                                      std::to_string(size.x) + "x" + std::to_string(size.y), "-framerate", rate, "-i",
                                      "pipe:0", "-an"};
    const std::string extension = lowerExtension(out);
    const std::vector<std::string> codec =
        extension == ".webm" ? std::vector<std::string>{"-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-row-mt", "1"}
                             : std::vector<std::string>{"-c:v", "libx264", "-crf", "18"};
    words.insert(words.end(), codec.begin(), codec.end());
    // Untagged, players guess the matrix by the size.
    const std::vector<std::string> colour = {
        "-pix_fmt", "yuv420p",          "-vf",  "scale=out_color_matrix=bt709", "-colorspace", "bt709", "-color_trc",
        "bt709",    "-color_primaries", "bt709"};
    words.insert(words.end(), colour.begin(), colour.end());
    if (extension == ".mp4" || extension == ".mov") words.insert(words.end(), {"-movflags", "+faststart"});
    words.push_back("file:" + out.string());  // whatever the name looks like, it is a file
    return words;
  }

  void start(const std::string& program, std::vector<std::string> words, int input) {
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, ::fileno(messages_.get()), STDERR_FILENO);
    const int failed = ::posix_spawn(&process_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed != 0) {
      process_ = -1;
      failSystem(reported_, "cannot start " + program, failed);
    }
  }

  int wait() {
    int status = 0;
    while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
    }
    process_ = -1;
    return status;
  }

  [[noreturn]] void fail(int status) {
    std::string text(4096, '\0');
    std::rewind(messages_.get());
    text.resize(std::fread(text.data(), 1, text.size(), messages_.get()));
    while (!text.empty() && text.back() == '\n') text.pop_back();
    if (text.empty()) {
      text = WIFSIGNALED(status) ? "ended by signal " + std::to_string(WTERMSIG(status))
                                 : "exit code " + std::to_string(WEXITSTATUS(status));
    }
    throw Error(ErrorKind::cannotWrite, reported_.string(), "ffmpeg failed: " + text);
  }

  const std::filesystem::path reported_;
  File messages_;  // what ffmpeg writes to its standard error
  std::unique_ptr<Descriptor> input_;
  pid_t process_ = -1;
};

std::vector<std::uint8_t> rgb8(const Image& image) {
  std::vector<std::uint8_t> bytes(image.data.size());
  std::transform(image.data.begin(), image.data.end(), bytes.begin(),
                 [](float value) { return static_cast<std::uint8_t>(std::clamp(value, 0.0f, 1.0f) * 255.0f + 0.5f); });
  return bytes;
}

void makeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  if (!folder.empty() && !std::filesystem::is_directory(folder, error)) {
    std::filesystem::create_directories(folder, error);
    if (error) throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + error.message());
  }
}

}  // namespace

std::string findProgram(const std::string& name) {
  const char* folders = std::getenv("PATH");
  std::istringstream list(folders ? folders : "");
  for (std::string folder; std::getline(list, folder, ':');) {
    const std::string path = (folder.empty() ? "." : folder) + "/" + name;
    if (isFile(path) && ::access(path.c_str(), X_OK) == 0) return path;
  }
  return "";
}

RecordTarget parseRecordTarget(const std::filesystem::path& path, const std::string& what, bool has_numbers) {
  const std::string extension = lowerExtension(path);
  if (contains(kVideoExtensions, extension) && path.has_stem()) return {path, true};
  std::error_code ignored;
  const std::string name = path.filename().string();
  const bool folder = std::filesystem::is_directory(path, ignored) || name.empty() ||
                      (extension.empty() && name.find('#') == std::string::npos);
  if (folder && !path.empty()) return {path / "####.png", false};
  const std::size_t first = name.find('#'), last = name.find_last_of('#');
  const bool one_run = first != std::string::npos && last - first < 10 &&
                       name.substr(first, last - first + 1).find_first_not_of('#') == std::string::npos;
  const bool picture = contains(kPictureExtensions, extension) && (has_numbers || extension != ".exr");
  if (one_run && last < name.size() - extension.size() && picture) return {path, false};
  throw Error(ErrorKind::usage,
              what + ": expected a video (.mp4, .mov, .mkv, .webm), pictures with # for the frame's number " +
                  (has_numbers ? "(frames/####.png, .jpg, .exr)"
                               : "(frames/####.png, .jpg; numbers as .exr are tgview --output's)") +
                  " or a folder (frames/), found \"" + path.string() + "\"");
}

std::filesystem::path framePath(const RecordTarget& target, std::size_t frame) {
  TG_ASSERT(!target.video, "only pictures have numbers");
  std::string name = target.path.filename().string();
  const std::size_t first = name.find('#'), count = name.find_last_of('#') - first + 1;
  std::string number = std::to_string(frame);
  if (number.size() < count) number.insert(0, count - number.size(), '0');
  name.replace(first, count, number);
  return target.path.parent_path() / name;
}

glm::ivec2 recordSize(const RecordTarget& target, glm::ivec2 size) {
  return target.video ? glm::max((size + 1) / 2 * 2, glm::ivec2(2)) : size;
}

FrameWriter::FrameWriter(RecordTarget target, glm::ivec2 size, double fps, std::size_t frames)
    : target_(std::move(target)), size_(size), fps_(fps) {
  if (!target_.video) {
    makeFolder(target_.path.parent_path());
    if (const std::filesystem::path next = framePath(target_, frames); isFile(next)) {
      throw Error(ErrorKind::cannotWrite, next.string(),
                  "a picture of a longer recording would stay among those of this one (expected none from " +
                      std::to_string(frames) + " on)");
    }
  }
  requireWritable(target_.video ? target_.path : framePath(target_, 0));
  if (target_.video) {
    ffmpeg_ = findProgram("ffmpeg");
    if (ffmpeg_.empty()) {
      throw Error(ErrorKind::cannotWrite, target_.path.string(),
                  "a video needs the ffmpeg program (expected ffmpeg in PATH, found none; a folder or frames/####.png "
                  "takes the pictures without it)");
    }
  }
  thread_ = startWorker(frames_, [this](const std::stop_token& stop) {
    const NextFrame next = [&] {
      std::optional<Image> frame = frames_.take(stop);
      if (stop.stop_requested()) throw Cancelled{};
      return frame;
    };
    try {
      target_.video ? writeVideo(next) : writePictures(next);
    } catch (const Cancelled&) {
      // As asked for: the temporary file is gone.
    }
  });
}

void FrameWriter::add(Image frame) {
  TG_ASSERT(frame.width == size_.x && frame.height == size_.y, "a frame has the recording's size");
  TG_ASSERT(frame.channels == 3 || (!target_.video && frame.channels == 1),
            "a frame has 3 channels, or 1 for pictures");
  [[maybe_unused]] const bool added = frames_.give(std::move(frame));
  TG_ASSERT(added, "no frame follows finish()");
}

void FrameWriter::finish() {
  frames_.close();
  thread_.join();
  while (frames_.poll()) {  // left by what stopped the thread, which is thrown behind it
  }
}

void FrameWriter::writePictures(const NextFrame& next) const {
  for (std::size_t number = 0; const auto frame = next(); ++number) writeDrawn(framePath(target_, number), *frame);
}

void FrameWriter::writeVideo(const NextFrame& next) const {
  writeFileAtomically(target_.path, [&](const std::filesystem::path& temporary) {
    Encoder encoder(ffmpeg_, temporary, target_.path, size_, fps_);
    while (const auto frame = next()) encoder.write(rgb8(*frame));
    encoder.finish();
  });
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Whole files in and out: bounded reads, atomic writes.
#pragma once
#include <atomic>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

namespace tg {

// Whether a regular file is there; false where nobody can tell.
inline bool isFile(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

// Throws Error(cannotRead) when missing, a folder, unreadable, or longer than max_bytes.
std::vector<std::uint8_t> readFile(const std::filesystem::path& path, std::uint64_t max_bytes);
// Of what another file names or a folder holds: throws also for a pipe or a device, which may have no end.
std::vector<std::uint8_t> readRegularFile(const std::filesystem::path& path, std::uint64_t max_bytes);

// Thrown out of a reader that was told to stop.
struct ReadCancelled : std::exception {
  const char* what() const noexcept override { return "reading was cancelled"; }
};

// How far a file has been read, for whoever waits for it in another thread; and the way to stop.
struct ByteProgress {
  std::atomic<std::uint64_t> done{0};   // [bytes] of the file
  std::atomic<std::uint64_t> total{0};  // [bytes]; 0: not known yet
  std::atomic<bool> cancel{false};

  // Throws ReadCancelled when told to.
  void advance(std::uint64_t bytes) {
    done += bytes;
    if (cancel) throw ReadCancelled();
  }
};

// A regular file, read piece by piece, from several threads at once if need be.
class FileReader {
 public:
  // Throws as readFile does, and for what is no regular file.
  FileReader(const std::filesystem::path& path, std::uint64_t max_bytes);
  ~FileReader();
  FileReader& operator=(FileReader&&) = delete;

  std::uint64_t size() const { return size_; }  // [bytes] when it was opened
  // Throws Error(cannotRead), also when the file has become too short.
  void read(std::uint64_t offset, std::span<std::uint8_t> out) const;

 private:
  std::string path_;
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
};

// A file that is there, overwritten piece by piece, from several threads at once if need be.
class FileWriter {
 public:
  // `reported` is the name in messages. Throws Error(cannotWrite).
  FileWriter(const std::filesystem::path& file, const std::filesystem::path& reported);
  ~FileWriter();
  FileWriter& operator=(FileWriter&&) = delete;

  void resize(std::uint64_t bytes) const;
  void write(std::uint64_t offset, std::span<const std::uint8_t> bytes) const;

 private:
  const std::string reported_;
  int descriptor_ = -1;
};

// Where a file by that name belongs: at the end of its symbolic links, whether anything is there or not. No other
// user's in a folder like /tmp is followed: it would lead to any file of ours. Throws Error(cannotWrite).
std::filesystem::path endOfLinks(const std::filesystem::path& path);

// The same, absolute and without links in its folders: equal for all names of one output, there or not. A folder's may
// end with a slash. Throws Error(cannotWrite).
std::filesystem::path placeOfOutput(const std::filesystem::path& path);

// Throws what writeFileAtomically would throw for a place that cannot be written: for use before hours of work.
void requireWritable(const std::filesystem::path& path);

// Writes to a temporary name beside `path`, or beside what it leads to where it is a symbolic link, syncs, renames; the
// link stays one. On any exception nothing is left behind. Throws Error(cannotWrite).
void writeFileAtomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);
void writeTextAtomically(const std::filesystem::path& path, const std::string& text);
// The same for content that is streamed: `write` fills the temporary file whose name it is given.
void writeFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const std::filesystem::path& temporary)>& write);

// A copy of a regular file, with the permissions of the older file, else of `source`. Throws cannotRead / cannotWrite.
void copyFileAtomically(const std::filesystem::path& source, const std::filesystem::path& path);

}  // namespace tg

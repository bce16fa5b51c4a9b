// SPDX-License-Identifier: Apache-2.0
// POSIX file input and output with bounds, fsync and rename.
#include "core/file/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <limits>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "core/file/atomic_files.h"
#include "core/file/quick_file.h"
#include "core/system/descriptor.h"
#include "core/system/error.h"
#include "core/system/temporary_files.h"

namespace tg {
namespace {

Error tooLong(const std::filesystem::path& path, std::uint64_t most, const std::string& found) {
  return {ErrorKind::cannotRead, path.string(),
          "file is too long" + expectedFound("at most " + std::to_string(most) + " bytes", found)};
}

std::filesystem::path folderOf(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.parent_path();
  return folder.empty() ? std::filesystem::path(".") : folder;
}

// Renaming over a device or a pipe would replace it (think of /dev/null).
void requireFileName(const std::filesystem::path& path) {
  std::error_code status;
  const auto type = std::filesystem::status(path, status).type();
  if (type == std::filesystem::file_type::none) {
    throw Error(ErrorKind::cannotWrite, path.string(), "cannot write here: " + status.message());
  }
  if (type != std::filesystem::file_type::not_found && type != std::filesystem::file_type::regular) {
    throw Error(ErrorKind::cannotWrite, path.string(), "exists and is not a regular file");
  }
  if (path.filename().empty()) throw Error(ErrorKind::cannotWrite, path.string(), "is no file name");
}

// A fresh empty file beside `place`, with the extension of `reported`, readable as the umask says. Removed unless
// released.
class TemporaryFile {
 public:
  TemporaryFile(const std::filesystem::path& place, const std::filesystem::path& reported) {
    static std::atomic<unsigned> counter{0};
    for (int attempt = 0; attempt < 100; ++attempt) {
      const std::string stem = ".tg-" + std::to_string(::getpid()) + "-" + std::to_string(counter++);
      path = folderOf(place) / (stem + reported.extension().string());
      name_.emplace(path);  // before the file is there: a signal may come at once
      const Descriptor file(::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0666));
      if (file.get() >= 0) return;
      if (errno != EEXIST)
        throw Error(ErrorKind::cannotWrite, reported.string(), "cannot write here: " + systemReason());
    }
    throw Error(ErrorKind::cannotWrite, reported.string(), "cannot write here: no free temporary name");
  }
  ~TemporaryFile() {
    if (!released) ::unlink(path.c_str());
  }
  TemporaryFile& operator=(TemporaryFile&&) = delete;

  std::filesystem::path path;
  bool released = false;

 private:
  std::optional<RemovedBySignal> name_;
};

// Who may read and write a file that is there.
std::optional<mode_t> modeOf(const std::filesystem::path& path) {
  struct stat found{};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode)) return std::nullopt;
  return found.st_mode & 0777;
}

void syncFile(const std::filesystem::path& file, const std::filesystem::path& reported) {
  const Descriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.get() < 0 || ::fsync(descriptor.get()) != 0) {
    throw Error(ErrorKind::cannotWrite, reported.string(), "cannot write to disk: " + systemReason());
  }
}

}  // namespace

std::filesystem::path endOfLinks(const std::filesystem::path& path) {
  constexpr int kMostLinks = 40;  // as Linux
  std::filesystem::path place = path;
  for (int links = 0;; ++links) {
    struct stat link{}, folder{};
    if (::lstat(place.c_str(), &link) != 0 || !S_ISLNK(link.st_mode)) return place;
    if (links == kMostLinks) {
      throw Error(ErrorKind::cannotWrite, path.string(), "cannot write here: too many symbolic links");
    }
    constexpr mode_t kShared = S_ISVTX | S_IWOTH;  // as the kernel's fs.protected_symlinks, which is for open()
    if (::stat(folderOf(place).c_str(), &folder) == 0 && (folder.st_mode & kShared) == kShared &&
        link.st_uid != ::geteuid() && link.st_uid != folder.st_uid) {
      throw Error(ErrorKind::cannotWrite, path.string(),
                  "cannot write here: another user's symbolic link in a folder that all may write to");
    }
    std::error_code status;
    const std::filesystem::path next = std::filesystem::read_symlink(place, status);
    if (status) throw Error(ErrorKind::cannotWrite, path.string(), "cannot write here: " + status.message());
    place = folderOf(place) / next;
  }
}

std::filesystem::path placeOfOutput(const std::filesystem::path& path) {
  const std::filesystem::path end = endOfLinks(path.has_filename() ? path : path.parent_path());
  std::error_code unknown;
  const std::filesystem::path absolute = std::filesystem::absolute(end, unknown),
                              place = std::filesystem::weakly_canonical(absolute, unknown);
  return place.empty() ? absolute.lexically_normal() : place;
}

std::vector<std::uint8_t> readFile(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) throw Error(ErrorKind::cannotRead, path.string(), "cannot open: " + systemReason());
  struct stat status{};
  if (::fstat(file.get(), &status) != 0)
    throw Error(ErrorKind::cannotRead, path.string(), "cannot read: " + systemReason());
  if (S_ISDIR(status.st_mode)) throw Error(ErrorKind::cannotRead, path.string(), "is a folder (expected a file)");
  const std::uint64_t size = S_ISREG(status.st_mode) ? static_cast<std::uint64_t>(status.st_size) : 0;
  if (size > max_bytes) throw tooLong(path, max_bytes, std::to_string(size));

  // The size is a hint only: pipes have none, and a file may grow while it is read.
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
  std::size_t used = 0;
  for (;;) {
    if (used == bytes.size()) {
      std::uint8_t probe[65536];
      const ssize_t got = ::read(file.get(), probe, sizeof(probe));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0) throw Error(ErrorKind::cannotRead, path.string(), "cannot read: " + systemReason());
      if (got == 0) break;
      if (used + static_cast<std::uint64_t>(got) > max_bytes) throw tooLong(path, max_bytes, "more");
      bytes.insert(bytes.end(), probe, probe + got);
      used = bytes.size();
      continue;
    }
    const ssize_t got = ::read(file.get(), bytes.data() + used, std::min<std::size_t>(bytes.size() - used, 1u << 30));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw Error(ErrorKind::cannotRead, path.string(), "cannot read: " + systemReason());
    if (got == 0) break;
    used += static_cast<std::size_t>(got);
  }
  bytes.resize(used);
  return bytes;
}

FileReader::FileReader(const std::filesystem::path& path, std::uint64_t max_bytes) : path_(path.string()) {
  // Not to wait for somebody who writes into a pipe.
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (file.get() < 0) throw Error(ErrorKind::cannotRead, path_, "cannot open: " + systemReason());
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) throw Error(ErrorKind::cannotRead, path_, "cannot read: " + systemReason());
  if (S_ISDIR(status.st_mode)) throw Error(ErrorKind::cannotRead, path_, "is a folder (expected a file)");
  if (!S_ISREG(status.st_mode)) throw Error(ErrorKind::cannotRead, path_, "is no regular file");
  size_ = static_cast<std::uint64_t>(status.st_size);
  if (size_ > max_bytes) throw tooLong(path, max_bytes, std::to_string(size_));
  descriptor_ = file.release();
}

FileReader::~FileReader() { ::close(descriptor_); }

void FileReader::read(std::uint64_t offset, std::span<std::uint8_t> out) const {
  while (!out.empty()) {
    const ssize_t got = ::pread(descriptor_, out.data(), out.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw Error(ErrorKind::cannotRead, path_, "cannot read: " + systemReason());
    if (got == 0) throw Error(ErrorKind::cannotRead, path_, "became shorter while it was read");
    out = out.subspan(static_cast<std::size_t>(got));
    offset += static_cast<std::uint64_t>(got);
  }
}

std::vector<std::uint8_t> readRegularFile(const std::filesystem::path& path, std::uint64_t max_bytes) {
  const FileReader file(path, max_bytes);
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(file.size()));
  file.read(0, bytes);
  return bytes;
}

FileWriter::FileWriter(const std::filesystem::path& file, const std::filesystem::path& reported)
    : reported_(reported.string()), descriptor_(::open(file.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC)) {
  if (descriptor_ < 0) throw Error(ErrorKind::cannotWrite, reported_, "cannot open: " + systemReason());
}

FileWriter::~FileWriter() { ::close(descriptor_); }

void FileWriter::resize(std::uint64_t bytes) const {
  if (::ftruncate(descriptor_, static_cast<off_t>(bytes)) != 0) {
    throw Error(ErrorKind::cannotWrite, reported_, "cannot write: " + systemReason());
  }
}

void FileWriter::write(std::uint64_t offset, std::span<const std::uint8_t> bytes) const {
  while (!bytes.empty()) {
    const std::size_t length = std::min<std::size_t>(bytes.size(), 1u << 30);
    const ssize_t written = ::pwrite(descriptor_, bytes.data(), length, static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw Error(ErrorKind::cannotWrite, reported_, "cannot write: " + systemReason());
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
}

void requireWritable(const std::filesystem::path& path) {
  requireFileName(path);
  // The final name itself: the temporary one is shorter than a name the file system may refuse.
  struct stat status{};
  if (::lstat(path.c_str(), &status) != 0 && errno != ENOENT) {
    throw Error(ErrorKind::cannotWrite, path.string(), "cannot write here: " + systemReason());
  }
  const TemporaryFile removed(endOfLinks(path), path);
}

struct AtomicFiles::Entry {
  explicit Entry(const std::filesystem::path& file) : reported(file), place(endOfLinks(file)), temporary(place, file) {}

  // What has the name now gets a second one, from which putBack() takes it again.
  void keepOlder() {
    older.emplace(place, reported);
    ::unlink(older->path.c_str());
    if (::link(place.c_str(), older->path.c_str()) != 0) older.reset();  // none, or a file system without links
  }
  void putBack() {
    if (!temporary.released) return;
    older ? ::rename(older->path.c_str(), place.c_str()) : ::unlink(place.c_str());
  }

  const std::filesystem::path reported, place;
  TemporaryFile temporary;
  std::optional<TemporaryFile> older;
};

namespace {

thread_local bool replaces = true;

Error existsAlready(const std::filesystem::path& path) {
  return {ErrorKind::cannotWrite, path.string(), "exists already (--overwrite replaces it)"};
}

// Gives a file its name unless another one has it: of several that try, one wins. False with errno.
bool renameWithoutReplacing(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  if (errno != EINVAL && errno != ENOSYS) return false;
  // A file system that does not know this.
  if (::link(from.c_str(), to.c_str()) == 0) return ::unlink(from.c_str()) == 0;
  if (errno == EEXIST) return false;
  struct stat status{};
  if (::lstat(to.c_str(), &status) != 0) return ::rename(from.c_str(), to.c_str()) == 0;
  errno = EEXIST;
  return false;
}

}  // namespace

KeepExisting::KeepExisting(bool keep) : before_(std::exchange(replaces, replaces && !keep)) {}
KeepExisting::~KeepExisting() { replaces = before_; }

bool createFolder(const std::filesystem::path& folder) {
  std::error_code status;
  const bool made = std::filesystem::create_directory(folder, status);
  if (status) throw Error(ErrorKind::cannotWrite, folder.string(), "cannot make this folder: " + status.message());
  return made;
}

FolderToFill::FolderToFill(const std::filesystem::path& folder) : folder_(folder) {
  std::error_code ignored;
  if (std::filesystem::exists(folder_, ignored)) return;
  named_.emplace(folder_, true);  // before it is there: a signal may come at once
  if (!createFolder(folder_)) keep();
}

FolderToFill::~FolderToFill() {
  if (named_) ::rmdir(folder_.c_str());
}

AtomicFiles::AtomicFiles(bool replace) : replace_(replace && replaces) {}
AtomicFiles::~AtomicFiles() = default;

void AtomicFiles::add(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write) {
  requireFileName(path);
  std::error_code ignored;
  if (!replace_ && std::filesystem::exists(path, ignored)) {
    throw existsAlready(path);
  }
  const Entry& entry = *entries_.emplace_back(std::make_unique<Entry>(path));
  // Nobody may read what is being written who might not read the older file.
  if (const auto mode = modeOf(path); replace_ && mode) (void)::chmod(entry.temporary.path.c_str(), *mode | 0600);
  write(entry.temporary.path);
  syncFile(entry.temporary.path, path);
}

void AtomicFiles::add(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  add(path, [&](const std::filesystem::path& temporary) { FileWriter(temporary, path).write(0, bytes); });
}

void AtomicFiles::commit() {
  if (entries_.size() > 1 && replace_) {
    for (const std::unique_ptr<Entry>& entry : entries_) entry->keepOlder();
  }
  for (const std::unique_ptr<Entry>& entry : entries_) {
    if (const auto mode = modeOf(entry->place); replace_ && mode) {
      (void)::chmod(entry->temporary.path.c_str(), *mode);
    }
    const bool renamed = replace_ ? ::rename(entry->temporary.path.c_str(), entry->place.c_str()) == 0
                                  : renameWithoutReplacing(entry->temporary.path, entry->place);
    if (!renamed) {
      const int reason = errno;
      for (const std::unique_ptr<Entry>& other : entries_) other->putBack();
      errno = reason;
      if (!replace_ && errno == EEXIST) throw existsAlready(entry->reported);
      throw Error(ErrorKind::cannotWrite, entry->reported.string(),
                  "cannot rename the finished file: " + systemReason());
    }
    entry->temporary.released = true;
    // Makes the new name itself durable. Some file systems cannot sync a folder; the content is safe either way.
    const Descriptor folder(::open(folderOf(entry->place).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (folder.get() >= 0) (void)::fsync(folder.get());
  }
  entries_.clear();
}

void writeFileAtomically(const std::filesystem::path& path,
                         const std::function<void(const std::filesystem::path& temporary)>& write) {
  AtomicFiles files;
  files.add(path, write);
  files.commit();
}

void writeFileQuickly(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write) {
  requireFileName(path);
  const std::filesystem::path place = endOfLinks(path);
  TemporaryFile file(place, path);
  write(file.path);
  if (::rename(file.path.c_str(), place.c_str()) != 0) {
    throw Error(ErrorKind::cannotWrite, path.string(), "cannot rename the finished file: " + systemReason());
  }
  file.released = true;
}

void writeFileAtomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  AtomicFiles files;
  files.add(path, bytes);
  files.commit();
}

void writeTextAtomically(const std::filesystem::path& path, const std::string& text) {
  writeFileAtomically(path, std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

void copyFileAtomically(const std::filesystem::path& source, const std::filesystem::path& path) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  const FileReader in(source, std::numeric_limits<std::uint64_t>::max());
  writeFileAtomically(path, [&](const std::filesystem::path& temporary) {
    const FileWriter out(temporary, path);
    struct stat status{};  // before the content: a private file's is nobody else's meanwhile
    if (!modeOf(path) && ::stat(source.c_str(), &status) == 0) (void)::chmod(temporary.c_str(), status.st_mode & 0777);
    std::vector<std::uint8_t> buffer(static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), kPiece)));
    for (std::uint64_t done = 0; done < in.size();) {
      const std::span piece = std::span(buffer).first(std::min<std::uint64_t>(in.size() - done, buffer.size()));
      in.read(done, piece);
      out.write(done, piece);
      done += piece.size();
    }
  });
}

}  // namespace tg

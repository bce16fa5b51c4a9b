// SPDX-License-Identifier: Apache-2.0
// ZIP archives by libarchive.
#include "converter/sog/zip.h"

#include <archive.h>
#include <archive_entry.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <new>
#include <string_view>

#include "core/file/file.h"
#include "core/system/error.h"

namespace tg {
namespace {

constexpr int kMaxEntries = 1024;
constexpr std::uint64_t kMaxRatio = 1000;
constexpr std::uint64_t kRatioFreeBytes = 1 << 20;
constexpr std::size_t kPieceBytes = 1 << 16;
constexpr std::string_view kEndMark = "PK\5\6";                    // begins the end of the directory
constexpr std::size_t kEndBytes = 22;                              // of that
constexpr std::size_t kLongestEnd = kEndBytes + ((1u << 16) - 1);  // of that with its comment

std::string reasonOf(archive* a, const char* otherwise) {
  if (archive_errno(a) == ENOMEM) throw std::bad_alloc();
  const char* text = archive_error_string(a);
  return text != nullptr ? text : otherwise;
}

}  // namespace

std::vector<std::uint8_t> ZipReader::read(const std::string& name, std::uint64_t most) const {
  const auto fail = [&](const std::string& what) { throw Error(ErrorKind::badData, path_, what); };
  const std::string_view text(reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
  const std::size_t end = text.size() < kEndBytes ? text.npos : text.rfind(kEndMark, text.size() - kEndBytes);
  if (end == text.npos || text.size() - end > kLongestEnd) {
    fail("the ZIP archive has no end of its directory (in " + std::to_string(text.size()) +
         " bytes): it may be cut off, or other bytes follow it");
  }
  const std::unique_ptr<archive, int (*)(archive*)> reader(archive_read_new(), archive_read_free);
  if (!reader) throw std::bad_alloc();
  archive_read_support_format_zip_seekable(reader.get());
  // Without what follows, in which libarchive looks for the end, 16 KiB far. In pieces: archive_filter_bytes() counts
  // no part of one, and a stored entry may lie in one whole.
  if (archive_read_open_memory2(reader.get(), bytes_.data(), end + kEndBytes, kPieceBytes) != ARCHIVE_OK) {
    fail("broken ZIP archive: " + reasonOf(reader.get(), "no entry"));
  }
  for (int i = 0;; ++i) {
    archive_entry* entry = nullptr;
    const int result = archive_read_next_header(reader.get(), &entry);
    if (result == ARCHIVE_EOF) fail("the ZIP archive has no entry \"" + name + "\"");
    if (result != ARCHIVE_OK && result != ARCHIVE_WARN) {
      fail("broken ZIP archive: " + reasonOf(reader.get(), "a broken header"));
    }
    if (i == kMaxEntries) fail("too many entries in the ZIP archive" + atMost(kMaxEntries, kMaxEntries + 1));
    const char* found = archive_entry_pathname(entry);
    if (found == nullptr || name != found) continue;
    if (archive_entry_is_encrypted(entry)) fail("entry \"" + name + "\" is encrypted");
    std::vector<std::uint8_t> out;
    const la_int64_t begin = archive_filter_bytes(reader.get(), -1);
    for (;;) {
      const std::size_t before = out.size();
      out.resize(before + kPieceBytes);
      const la_ssize_t got = archive_read_data(reader.get(), out.data() + before, kPieceBytes);
      if (got < 0) fail("entry \"" + name + "\" is broken: " + reasonOf(reader.get(), "unexpected data"));
      out.resize(before + static_cast<std::size_t>(got));
      if (got == 0) return out;
      const auto packed = static_cast<std::uint64_t>(archive_filter_bytes(reader.get(), -1) - begin);
      const std::uint64_t inflated = std::max(packed * kMaxRatio, kRatioFreeBytes);
      if (out.size() > std::min(most, inflated)) {
        fail("entry \"" + name + "\" is too long" + atMost(std::min(most, inflated), out.size()));
      }
    }
  }
}

void writeZip(const std::filesystem::path& file, std::span<const ZipEntry> entries,
              const std::filesystem::path& reported) {
  const std::unique_ptr<archive, int (*)(archive*)> writer(archive_write_new(), archive_write_free);
  if (!writer) throw std::bad_alloc();
  archive* a = writer.get();
  const auto check = [&](int result) {
    if (result == ARCHIVE_OK) return;
    const int number = archive_errno(a);  // errno's, or below 0
    if (number == ENOMEM) throw std::bad_alloc();
    throw Error(
        ErrorKind::cannotWrite, reported.string(),
        "cannot write: " + (number > 0 ? std::generic_category().message(number) : reasonOf(a, "the ZIP archive")));
  };
  check(archive_write_set_format_zip(a));
  check(archive_write_open_filename(a, file.c_str()));
  for (const ZipEntry& entry : entries) {
    const std::unique_ptr<archive_entry, void (*)(archive_entry*)> header(archive_entry_new(), archive_entry_free);
    if (!header) throw std::bad_alloc();
    check(entry.deflate ? archive_write_zip_set_compression_deflate(a) : archive_write_zip_set_compression_store(a));
    archive_entry_set_pathname(header.get(), entry.name.c_str());
    archive_entry_set_size(header.get(), static_cast<la_int64_t>(entry.bytes.size()));
    archive_entry_set_filetype(header.get(), AE_IFREG);
    archive_entry_set_perm(header.get(), 0644);
    check(archive_write_header(a, header.get()));
    for (std::span<const std::uint8_t> left = entry.bytes; !left.empty();) {
      const la_ssize_t got = archive_write_data(a, left.data(), left.size());
      if (got <= 0) check(ARCHIVE_FATAL);
      left = left.subspan(static_cast<std::size_t>(got));
    }
  }
  check(archive_write_close(a));
}

}  // namespace tg

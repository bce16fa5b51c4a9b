// SPDX-License-Identifier: Apache-2.0
// Preloaded, it makes one call of a program fail: TG_FAULT="KIND:K:FILE" the K-th of that kind after main has begun (0:
// none). FILE gets the name of what failed, or how many calls there were. Kinds: memory, open, read, write, sync,
// rename, thread, kill (the process, by SIGKILL, before a call of open, write, sync or rename), and those of
// inject_device.cpp. With "all:0:FILE" it gets a line "KIND CALLS" for each of the former.
#include "inject.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include <dlfcn.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

namespace tg::test {
namespace {

std::atomic<bool> counting;  // only between main's first and last line: loaders and exit handlers are not ours
std::atomic<std::uint64_t> calls;
std::uint64_t chosen;
char kind[16], report[4096];
struct Kind {
  const char* name;
  std::atomic<std::uint64_t> calls;
};
Kind kinds[] = {{"memory", 0}, {"open", 0},   {"read", 0},   {"write", 0},
                {"sync", 0},   {"rename", 0}, {"thread", 0}, {"kill", 0}};
bool counts_all;
std::atomic<bool> failed;

void tell(const char* text) {
  const long file = syscall(SYS_openat, AT_FDCWD, report, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  syscall(SYS_write, file, text, std::strlen(text));
  syscall(SYS_close, file);
}

}  // namespace

bool isChosen(const char* of, const char* name) {
  if (!counting.load(std::memory_order_relaxed)) return false;
  if (counts_all) {
    for (Kind& each : kinds) each.calls += std::strcmp(each.name, of) == 0;
    return false;
  }
  if (std::strcmp(kind, of) != 0 || ++calls != chosen) return false;
  failed = true;
  tell(name);
  return true;
}

namespace {

bool changesFiles(const char* of) {
  for (const char* name : {"open", "write", "sync", "rename"}) {
    if (std::strcmp(of, name) == 0) return true;
  }
  return false;
}

bool fails(const char* of, int error) {
  if (changesFiles(of) && isChosen("kill", of)) kill(getpid(), SIGKILL);
  if (!isChosen(of, of)) return false;
  errno = error;
  return true;
}

// A program that memory fails for a few bytes is lost anyway.
constexpr std::size_t kLeast = 1024;

// libcrypto (3.0.19, when it starts) and libarchive (3.6.2, when it writes a ZIP) crash, libarchive and OpenEXR
// (3.1.5) report something else.
bool copesWithNone(void* caller) {
  // dladdr() would wait for a lock that a thread in dlopen() holds while it waits for one of this allocation's caller.
  dl_find_object library{};
  if (_dl_find_object(caller, &library) != 0) return false;
  for (const char* name : {"libcrypto", "libarchive", "libOpenEXR"}) {
    if (std::strstr(library.dlfo_link_map->l_name, name)) return true;
  }
  return false;
}

bool noMemory(std::size_t size, void* caller) {
  return counting.load(std::memory_order_relaxed) && size >= kLeast && !copesWithNone(caller) &&
         fails("memory", ENOMEM);
}

template <typename Function>
Function next(Function, const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

int (*program)(int, char**, char**);

int countedMain(int argc, char** argv, char** environment) {
  if (const char* wish = std::getenv("TG_FAULT")) {
    std::sscanf(wish, "%15[^:]:%lu:%4095s", kind, &chosen, report);
    counts_all = std::strcmp(kind, "all") == 0;
    unsetenv("LD_PRELOAD");  // children are not meant
    takeGl();
    counting = true;
  }
  return program(argc, argv, environment);
}

__attribute__((destructor)) void tellCount() {
  counting = false;
  if (report[0] == 0 || failed) return;
  char text[512];
  if (counts_all) {
    std::size_t length = 0;
    for (const Kind& each : kinds) {
      length += std::snprintf(text + length, sizeof text - length, "%s %lu\n", each.name, each.calls.load());
    }
  } else {
    std::snprintf(text, sizeof text, "%lu", calls.load());
  }
  tell(text);
}

}  // namespace
}  // namespace tg::test

using namespace tg::test;

#define TG_NEXT(name) static const auto real = next(&name, #name)

extern "C" {

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*begin)(), void (*end)(),
                      void (*loaded)(), void* stack) {
  TG_NEXT(__libc_start_main);
  program = main;
  return real(countedMain, argc, argv, begin, end, loaded, stack);
}

void* malloc(std::size_t size) { return noMemory(size, __builtin_return_address(0)) ? nullptr : __libc_malloc(size); }
void* calloc(std::size_t n, std::size_t size) {
  return noMemory(n * size, __builtin_return_address(0)) ? nullptr : __libc_calloc(n, size);
}
void* realloc(void* old, std::size_t size) {
  return noMemory(size, __builtin_return_address(0)) ? nullptr : __libc_realloc(old, size);
}
void* memalign(std::size_t align, std::size_t size) {
  return noMemory(size, __builtin_return_address(0)) ? nullptr : __libc_memalign(align, size);
}
void* aligned_alloc(std::size_t align, std::size_t size) {
  return noMemory(size, __builtin_return_address(0)) ? nullptr : __libc_memalign(align, size);
}
int posix_memalign(void** out, std::size_t align, std::size_t size) {
  if (noMemory(size, __builtin_return_address(0))) return ENOMEM;
  *out = __libc_memalign(align, size);
  return *out || size == 0 ? 0 : ENOMEM;
}

#define TG_OPEN(name)                                                                                       \
  int name(const char* path, int flags, ...) {                                                              \
    std::va_list more;                                                                                      \
    va_start(more, flags);                                                                                  \
    const int mode = va_arg(more, int);                                                                     \
    va_end(more);                                                                                           \
    return fails("open", EMFILE) ? -1 : static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode)); \
  }
TG_OPEN(open)
TG_OPEN(open64)
FILE* fopen(const char* path, const char* mode) {
  TG_NEXT(fopen);
  return fails("open", EMFILE) ? nullptr : real(path, mode);
}
FILE* fopen64(const char* path, const char* mode) { return fopen(path, mode); }

ssize_t read(int file, void* to, std::size_t size) {
  return fails("read", EIO) ? -1 : syscall(SYS_read, file, to, size);
}
ssize_t pread64(int file, void* to, std::size_t size, off64_t at) {
  return fails("read", EIO) ? -1 : syscall(SYS_pread64, file, to, size, at);
}
ssize_t pread(int file, void* to, std::size_t size, off_t at) { return pread64(file, to, size, at); }

ssize_t write(int file, const void* from, std::size_t size) {
  return fails("write", ENOSPC) ? -1 : syscall(SYS_write, file, from, size);
}
ssize_t writev(int file, const iovec* parts, int count) {
  return fails("write", ENOSPC) ? -1 : syscall(SYS_writev, file, parts, count);
}
ssize_t pwrite64(int file, const void* from, std::size_t size, off64_t at) {
  return fails("write", ENOSPC) ? -1 : syscall(SYS_pwrite64, file, from, size, at);
}
ssize_t pwrite(int file, const void* from, std::size_t size, off_t at) { return pwrite64(file, from, size, at); }
int ftruncate64(int file, off64_t size) {
  return fails("write", ENOSPC) ? -1 : static_cast<int>(syscall(SYS_ftruncate, file, size));
}
int ftruncate(int file, off_t size) { return ftruncate64(file, size); }
std::size_t fwrite(const void* from, std::size_t size, std::size_t n, FILE* file) {
  TG_NEXT(fwrite);
  return file != stderr && fails("write", ENOSPC) ? 0 : real(from, size, n, file);
}
int fclose(FILE* file) {
  TG_NEXT(fclose);
  const bool failed = fails("write", ENOSPC);
  const int closed = real(file);
  if (failed) errno = ENOSPC;
  return failed ? EOF : closed;
}

int fsync(int file) { return fails("sync", EIO) ? -1 : static_cast<int>(syscall(SYS_fsync, file)); }
int fdatasync(int file) { return fails("sync", EIO) ? -1 : static_cast<int>(syscall(SYS_fdatasync, file)); }
int rename(const char* from, const char* to) {
  return fails("rename", EIO) ? -1 : static_cast<int>(syscall(SYS_rename, from, to));
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  return fails("rename", EIO) ? -1 : static_cast<int>(syscall(SYS_renameat2, from_folder, from, to_folder, to, flags));
}
int link(const char* from, const char* to) {
  return fails("rename", EIO) ? -1 : static_cast<int>(syscall(SYS_link, from, to));
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*body)(void*), void* argument) {
  TG_NEXT(pthread_create);
  return fails("thread", EAGAIN) ? EAGAIN : real(thread, attributes, body, argument);
}
}

// SPDX-License-Identifier: Apache-2.0
// Loaded before libc (LD_PRELOAD): lets one call of a program fail, or all from one on, as disks and memory do.
//   FAULT_KIND=write|sync|rename|open|memory  FAULT_AT=N   the N-th call of this kind fails (1 is the first); 0: none
//   FAULT_LASTS=1                                          and every one after it: a full disk
//   FAULT_COUNT=FILE                                       how many calls of the kind there were, at the end
// Of files, only those below FAULT_FOLDER count; of memory, what is asked for while main() runs.
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/uio.h>
#include <unistd.h>

namespace {

enum class Kind { kNone, kWrite, kSync, kRename, kOpen, kMemory };

struct Plan {
  Kind kind = Kind::kNone;
  long at = 0;
  bool lasts = false;
  const char* folder = "";
  const char* count_file = nullptr;
};

std::atomic<long> calls{0};
std::atomic<bool> is_ready{false};
Plan plan;

__attribute__((constructor)) void read_plan() {
  const char* kind = std::getenv("FAULT_KIND");
  const char* at = std::getenv("FAULT_AT");
  if (kind == nullptr) return;
  plan.kind = std::strcmp(kind, "write") == 0    ? Kind::kWrite
              : std::strcmp(kind, "sync") == 0   ? Kind::kSync
              : std::strcmp(kind, "rename") == 0 ? Kind::kRename
              : std::strcmp(kind, "open") == 0   ? Kind::kOpen
                                                 : Kind::kMemory;
  plan.at = at == nullptr ? 0 : std::atol(at);
  plan.lasts = std::getenv("FAULT_LASTS") != nullptr;
  if (const char* folder = std::getenv("FAULT_FOLDER")) plan.folder = folder;
  plan.count_file = std::getenv("FAULT_COUNT");
}

void write_count() {
  if (!is_ready.exchange(false) || plan.count_file == nullptr) return;
  if (FILE* file = std::fopen(plan.count_file, "w")) {
    std::fprintf(file, "%ld\n", calls.load());
    std::fclose(file);
  }
}

bool fails(Kind kind) {
  if (!is_ready || plan.kind != kind) return false;
  const long number = ++calls;
  return plan.at > 0 && (plan.lasts ? number >= plan.at : number == plan.at);
}

bool is_below(const char* path) {
  return path != nullptr && std::strncmp(path, plan.folder, std::strlen(plan.folder)) == 0;
}

bool is_below(int descriptor) {
  char name[64], path[4096];
  std::snprintf(name, sizeof name, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(name, path, sizeof path - 1);
  if (length <= 0) return false;
  path[length] = '\0';
  return is_below(path);
}

template <typename Function>
Function* real(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}
#define REAL(name) static auto* const next = real(&name, #name)

bool fails_on_file(Kind kind, int descriptor) { return plan.kind == kind && is_below(descriptor) && fails(kind); }

}  // namespace

extern "C" {

using Main = int(int, char**, char**);
static Main* program_main = nullptr;
static int watched_main(int count, char** arguments, char** environment) {
  is_ready = plan.kind != Kind::kNone;
  const int code = program_main(count, arguments, environment);
  write_count();
  return code;
}
int __libc_start_main(Main* main, int count, char** arguments, void (*init)(), void (*fini)(), void (*rtld_fini)(),
                      void* stack_end) {
  REAL(__libc_start_main);
  program_main = main;
  return next(watched_main, count, arguments, init, fini, rtld_fini, stack_end);
}

ssize_t write(int descriptor, const void* data, size_t size) {
  REAL(write);
  if (fails_on_file(Kind::kWrite, descriptor)) return errno = ENOSPC, -1;
  return next(descriptor, data, size);
}
ssize_t pwrite64(int descriptor, const void* data, size_t size, off64_t at) {
  REAL(pwrite64);
  if (fails_on_file(Kind::kWrite, descriptor)) return errno = ENOSPC, -1;
  return next(descriptor, data, size, at);
}
ssize_t pwrite(int descriptor, const void* data, size_t size, off_t at) {
  REAL(pwrite);
  if (fails_on_file(Kind::kWrite, descriptor)) return errno = ENOSPC, -1;
  return next(descriptor, data, size, at);
}
ssize_t writev(int descriptor, const struct iovec* pieces, int count) {
  REAL(writev);
  if (fails_on_file(Kind::kWrite, descriptor)) return errno = ENOSPC, -1;
  return next(descriptor, pieces, count);
}
int ftruncate64(int descriptor, off64_t size) noexcept {
  REAL(ftruncate64);
  if (fails_on_file(Kind::kWrite, descriptor)) return errno = ENOSPC, -1;
  return next(descriptor, size);
}
int fsync(int descriptor) {
  REAL(fsync);
  if (fails_on_file(Kind::kSync, descriptor)) return errno = EIO, -1;
  return next(descriptor);
}
int fdatasync(int descriptor) {
  REAL(fdatasync);
  if (fails_on_file(Kind::kSync, descriptor)) return errno = EIO, -1;
  return next(descriptor);
}
int rename(const char* from, const char* to) noexcept {
  REAL(rename);
  if (plan.kind == Kind::kRename && is_below(to) && fails(Kind::kRename)) return errno = EIO, -1;
  return next(from, to);
}
int open64(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  static auto* const next = reinterpret_cast<int (*)(const char*, int, ...)>(dlsym(RTLD_NEXT, "open64"));
  if (plan.kind == Kind::kOpen && is_below(path) && fails(Kind::kOpen)) return errno = EMFILE, -1;
  return next(path, flags, mode);
}
FILE* fopen64(const char* path, const char* mode) {
  REAL(fopen64);
  if (plan.kind == Kind::kOpen && is_below(path) && fails(Kind::kOpen)) return errno = EMFILE, nullptr;
  return next(path, mode);
}

// Through glibc's own names: dlsym() allocates.
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* memory, size_t size);
void* __libc_memalign(size_t alignment, size_t size);
void* malloc(size_t size) { return fails(Kind::kMemory) ? (errno = ENOMEM, nullptr) : __libc_malloc(size); }
void* calloc(size_t count, size_t size) {
  return fails(Kind::kMemory) ? (errno = ENOMEM, nullptr) : __libc_calloc(count, size);
}
void* realloc(void* memory, size_t size) {
  return fails(Kind::kMemory) ? (errno = ENOMEM, nullptr) : __libc_realloc(memory, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  return fails(Kind::kMemory) ? (errno = ENOMEM, nullptr) : __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, size_t alignment, size_t size) {
  if (fails(Kind::kMemory)) return ENOMEM;
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}

}  // extern "C"

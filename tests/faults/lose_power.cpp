// SPDX-License-Identifier: Apache-2.0
// Loaded before libc (LD_PRELOAD): the power fails at a write. What was written to a file since it was synced last may
// be on the disk or not, each write by itself, as on drives that put writes off and change their order.
// A new name is on the disk at once, whatever of the file is.
//   POWER_AT=N       before the N-th write (1 is the first) to a file below POWER_FOLDER, or after it, where it is a
//   new
//                    name; 0: never
//   POWER_SEED=S     decides which of the writes reached the disk
//   POWER_COUNT=FILE how many writes there were, at the end
#include <algorithm>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

namespace {

template <typename Function>
Function* real(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}
#define REAL(name) static auto* const next = real(&name, #name)

// A write, or a new length (`data` is then empty), that was not synced yet.
struct Change {
  ino_t file;
  std::string path;
  off_t at = 0, length_before = 0;
  std::string before, data;
  bool is_length = false;
};

class Disk {
 public:
  Disk() {
    const char* folder = std::getenv("POWER_FOLDER");
    if (folder != nullptr) folder_ = folder;
    if (const char* at = std::getenv("POWER_AT")) power_at_ = std::atol(at);
    if (const char* seed = std::getenv("POWER_SEED")) chance_.seed(static_cast<unsigned>(std::atol(seed)));
  }
  ~Disk() {
    const char* const name = std::getenv("POWER_COUNT");
    if (FILE* file = name == nullptr ? nullptr : std::fopen(name, "w")) {
      std::fprintf(file, "%ld\n", writes_);
      std::fclose(file);
    }
  }

  // Before a write to `descriptor`, at this place; for a new length, without data.
  void note(int descriptor, off_t at, const void* data, std::size_t size, bool is_length) {
    const std::string path = path_of(descriptor);
    if (folder_.empty() || !path.starts_with(folder_)) return;
    const std::lock_guard lock(mutex_);
    if (++writes_ == power_at_) fail();
    struct stat status {};
    fstat(descriptor, &status);
    Change change{status.st_ino, path, at, status.st_size, {}, {}, is_length};
    if (!is_length) change.data.assign(static_cast<const char*>(data), size);
    const off_t end = is_length ? status.st_size : std::min<off_t>(status.st_size, at + static_cast<off_t>(size));
    if (end > at) {
      change.before.resize(static_cast<std::size_t>(end - at));
      const int reader = open(path.c_str(), O_RDONLY | O_CLOEXEC);  // the descriptor may be for writing alone
      if (pread(reader, change.before.data(), change.before.size(), at) < 0) change.before.clear();
      close(reader);
    }
    changes_.push_back(std::move(change));
  }

  // After a file or folder got another name, or (`is_exchange`) the two changed places.
  void renamed(const std::string& from, const std::string& to, bool is_exchange) {
    if (folder_.empty() || !to.starts_with(folder_)) return;
    const std::lock_guard lock(mutex_);
    for (Change& each : changes_) {
      const auto moved = [&](const std::string& a, const std::string& b) {
        if (each.path != a && !each.path.starts_with(a + "/")) return false;
        each.path = b + each.path.substr(a.size());
        return true;
      };
      if (!moved(from, to) && is_exchange) moved(to, from);
    }
    if (++writes_ == power_at_) fail();
  }

  void synced(int descriptor) {
    struct stat status {};
    fstat(descriptor, &status);
    const std::lock_guard lock(mutex_);
    std::erase_if(changes_, [&](const Change& each) { return each.file == status.st_ino; });
  }

 private:
  static std::string path_of(int descriptor) {
    char path[4096];
    const ssize_t length = readlink(("/proc/self/fd/" + std::to_string(descriptor)).c_str(), path, sizeof path);
    return length > 0 ? std::string(path, static_cast<std::size_t>(length)) : std::string();
  }

  // No thread of the program runs on: another process stops it, sees to the disk, and kills it.
  [[noreturn]] void fail() {
    const pid_t program = getpid();
    if (fork() == 0) {
      kill(program, SIGSTOP);
      while (!is_stopped(program)) usleep(100);
      leave_what_reached_the_disk();
      kill(program, SIGKILL);
      _exit(0);
    }
    while (true) pause();
  }

  static bool is_stopped(pid_t program) {
    for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(program) + "/task")) {
      char text[512] = {};
      const int file = open((thread.path() / "stat").c_str(), O_RDONLY | O_CLOEXEC);
      (void)!read(file, text, sizeof text - 1);
      close(file);
      const char* const name_end = std::strrchr(text, ')');  // "12 (name) T ..."
      if (name_end != nullptr && name_end[2] != 'T') return false;
    }
    return true;
  }

  // All that was not synced is taken back; some of it is then written again, in its order.
  void leave_what_reached_the_disk() {
    static auto* const write_at = reinterpret_cast<decltype(&pwrite)>(dlsym(RTLD_NEXT, "pwrite"));
    static auto* const set_length = reinterpret_cast<decltype(&ftruncate)>(dlsym(RTLD_NEXT, "ftruncate"));
    for (auto it = changes_.rbegin(); it != changes_.rend(); ++it) {
      const int file = open(it->path.c_str(), O_WRONLY | O_CLOEXEC);
      if (file < 0) continue;
      if (!it->before.empty()) (void)!write_at(file, it->before.data(), it->before.size(), it->at);
      (void)!set_length(file, it->length_before);
      close(file);
    }
    for (const Change& each : changes_) {
      if (chance_() % 2 == 0) continue;
      const int file = open(each.path.c_str(), O_WRONLY | O_CLOEXEC);
      if (file < 0) continue;
      if (each.is_length)
        (void)!set_length(file, each.at);
      else
        (void)!write_at(file, each.data.data(), each.data.size(), each.at);
      close(file);
    }
  }

  std::string folder_;
  long power_at_ = 0, writes_ = 0;
  std::mt19937 chance_;
  std::mutex mutex_;
  std::vector<Change> changes_;
};

Disk& disk() {
  static Disk one;
  return one;
}

}  // namespace

extern "C" {

ssize_t write(int descriptor, const void* data, size_t size) {
  REAL(write);
  struct stat status {};
  if (fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode)) {
    const bool appends = (fcntl(descriptor, F_GETFL) & O_APPEND) != 0;
    disk().note(descriptor, appends ? status.st_size : lseek(descriptor, 0, SEEK_CUR), data, size, false);
  }
  return next(descriptor, data, size);
}
ssize_t writev(int descriptor, const struct iovec* pieces, int count) {
  ssize_t written = 0;
  for (int i = 0; i < count; ++i) {
    const ssize_t now = write(descriptor, pieces[i].iov_base, pieces[i].iov_len);
    if (now < 0) return written > 0 ? written : now;
    written += now;
  }
  return written;
}
ssize_t pwrite64(int descriptor, const void* data, size_t size, off64_t at) {
  REAL(pwrite64);
  disk().note(descriptor, at, data, size, false);
  return next(descriptor, data, size, at);
}
ssize_t pwrite(int descriptor, const void* data, size_t size, off_t at) {
  REAL(pwrite);
  disk().note(descriptor, at, data, size, false);
  return next(descriptor, data, size, at);
}
int ftruncate64(int descriptor, off64_t size) noexcept {
  REAL(ftruncate64);
  disk().note(descriptor, size, nullptr, 0, true);
  return next(descriptor, size);
}
int rename(const char* from, const char* to) noexcept {
  REAL(rename);
  const int done = next(from, to);
  if (done == 0) disk().renamed(from, to, false);
  return done;
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
  REAL(renameat2);
  const int done = next(from_folder, from, to_folder, to, flags);
  if (done == 0) disk().renamed(from, to, (flags & RENAME_EXCHANGE) != 0);
  return done;
}
int fsync(int descriptor) {
  REAL(fsync);
  const int done = next(descriptor);
  if (done == 0) disk().synced(descriptor);
  return done;
}
int fdatasync(int descriptor) {
  REAL(fdatasync);
  const int done = next(descriptor);
  if (done == 0) disk().synced(descriptor);
  return done;
}

}  // extern "C"

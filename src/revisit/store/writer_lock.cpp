// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/internal/writer_lock.hpp>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>
#include <utility>

namespace revisit::store_internal {
namespace {

// Whoever had the lock takes the file away: what was opened before is then no longer what others open.
bool is_still_there(int descriptor, const std::filesystem::path& file) {
  struct stat opened {
  }, named{};
  return fstat(descriptor, &opened) == 0 && stat(file.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
         opened.st_dev == named.st_dev;
}

}  // namespace

WriterLock::WriterLock(std::filesystem::path file, int descriptor) : file_(std::move(file)), descriptor_(descriptor) {}

WriterLock::WriterLock(WriterLock&& other) noexcept
    : file_(std::move(other.file_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

WriterLock::~WriterLock() {
  if (descriptor_ < 0) return;
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
  close(descriptor_);
}

Result<WriterLock> WriterLock::take(const std::filesystem::path& map) {
  using namespace std::chrono_literals;
  constexpr auto kPatience = 2s;
  constexpr auto kPause = 20ms;
  const std::filesystem::path file = map.string() + ".lock";
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (true) {
    constexpr int kMode = 0666;
    const int descriptor = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, kMode);
    if (descriptor < 0) return Error{map.string() + ": cannot be written: " + std::generic_category().message(errno)};
    WriterLock lock(file, descriptor);
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) {
      if (is_still_there(descriptor, file)) return lock;
      lock.file_.clear();  // the file of that name is another one's
      continue;
    }
    const int reason = errno;
    lock.file_.clear();
    if (reason != EWOULDBLOCK && reason != EINTR)
      return Error{file.string() + ": cannot be locked: " + std::generic_category().message(reason)};
    if (std::chrono::steady_clock::now() > until)
      return Error{map.string() + ": another program writes this map; wait until it has ended"};
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace revisit::store_internal

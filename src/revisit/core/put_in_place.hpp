// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <revisit/core/result.hpp>

namespace revisit {

/// A file, or a folder with all that is in it, which was written under another name on the same filesystem, gets its
/// own: after a kill or a loss of power the name leads to what was there before or to all that is new (a folder that
/// replaces another one, on Linux alone). Errors name the file. Any thread.
inline Status put_in_place(const std::filesystem::path& written, const std::filesystem::path& name) {
  namespace fs = std::filesystem;
  std::error_code failure;
  const auto is_on_disk = [](const fs::path& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0) return false;
    const bool is_synced = ::fsync(descriptor) == 0 || errno == EINVAL;  // a filesystem that knows no sync
    ::close(descriptor);
    return is_synced;
  };
  const auto fail = [&](const std::error_code& why) {
    return Error{name.string() + ": cannot be written: " + why.message()};
  };
  bool is_synced = is_on_disk(written);
  if (fs::is_directory(written, failure))
    for (fs::recursive_directory_iterator it(written, failure), end; !failure && it != end; it.increment(failure))
      is_synced = is_synced && is_on_disk(it->path());
  if (failure) return fail(failure);
  if (!is_synced) return fail(std::error_code(errno, std::generic_category()));
  // A folder that holds something cannot be replaced; where the system can, the two change places.
  bool is_there = false;
  if (fs::is_directory(name, failure)) {
#ifdef RENAME_EXCHANGE
    is_there = ::renameat2(AT_FDCWD, written.c_str(), AT_FDCWD, name.c_str(), RENAME_EXCHANGE) == 0;
#endif
    if (!is_there) fs::remove_all(name, failure);
  }
  failure.clear();
  if (!is_there) fs::rename(written, name, failure);
  if (failure) return fail(failure);
  is_on_disk(fs::absolute(name).parent_path());
  if (is_there) fs::remove_all(written, failure);
  return ok();
}

}  // namespace revisit

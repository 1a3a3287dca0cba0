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
  const auto sync = [&failure](const fs::path& path) {
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor < 0 || (::fsync(descriptor) != 0 && errno != EINVAL))  // EINVAL: a filesystem that knows no sync
      failure.assign(errno, std::generic_category());
    if (descriptor >= 0) ::close(descriptor);
  };
  const auto fail = [&](const std::error_code& why) {
    return Error{name.string() + ": cannot be written: " + why.message()};
  };
  sync(written);
  std::error_code of_folder;
  if (fs::is_directory(written, of_folder))
    for (fs::recursive_directory_iterator it(written, of_folder), end; !of_folder && it != end; it.increment(of_folder))
      sync(it->path());
  if (failure || of_folder) return fail(failure ? failure : of_folder);
  // A folder that holds something cannot be replaced; where the system can, the two change places.
  bool is_there = false;
  std::error_code ignored;
  if (fs::is_directory(name, ignored)) {
#ifdef RENAME_EXCHANGE
    is_there = ::renameat2(AT_FDCWD, written.c_str(), AT_FDCWD, name.c_str(), RENAME_EXCHANGE) == 0;
#endif
    if (!is_there) fs::remove_all(name, ignored);
  }
  if (!is_there) fs::rename(written, name, failure);
  if (failure) return fail(failure);
  sync(fs::absolute(name).parent_path());
  if (is_there) fs::remove_all(written, ignored);
  return failure ? Status(fail(failure)) : ok();
}

}  // namespace revisit

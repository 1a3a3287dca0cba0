// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace revisit::fuzz {

/// One of the library's readers of files, with what a file of its kind is called.
struct Reader {
  const char* name;
  const char* file;                                 ///< name for the bytes: readers tell formats by it
  void (*read)(const std::filesystem::path& file);  ///< aborts where a result is not consistent, or an error is mute
};
std::span<const Reader> readers();
/// Null for names of none.
const Reader* find_reader(const std::string& name);

}  // namespace revisit::fuzz

// SPDX-License-Identifier: Apache-2.0
#include <revisit/retrieval/internal/mapped_file.hpp>

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace revisit::retrieval_internal {

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(const_cast<std::uint8_t*>(data_), size_);
}

Result<MappedFile> MappedFile::open(const std::string& path) {
  const auto failure = [&] { return Error{path + ": " + std::generic_category().message(errno)}; };
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return failure();
  struct stat status {};
  if (::fstat(file, &status) != 0) {
    Error error = failure();
    ::close(file);
    return error;
  }
  if (!S_ISREG(status.st_mode)) {
    ::close(file);
    return Error{path + ": is no regular file"};
  }
  MappedFile result;
  if (status.st_size > 0) {
    void* const data = ::mmap(nullptr, static_cast<std::size_t>(status.st_size), PROT_READ, MAP_PRIVATE, file, 0);
    if (data == MAP_FAILED) {
      Error error = failure();
      ::close(file);
      return error;
    }
    result.data_ = static_cast<const std::uint8_t*>(data);
    result.size_ = static_cast<std::size_t>(status.st_size);
  }
  ::close(file);
  return result;
}

}  // namespace revisit::retrieval_internal

// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/random_access_file.hpp>

#include <cerrno>
#include <new>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <revisit/io/internal/bytes.hpp>

namespace revisit::io_internal {

SharedBytes allocate(std::size_t size, std::uint8_t*& writable) {
  std::shared_ptr<std::uint8_t[]> owner(new (std::nothrow) std::uint8_t[size]);  // not set to zero
  writable = owner.get();
  return {owner, {owner.get(), owner ? size : 0}};
}

Result<RandomAccessFile> RandomAccessFile::open(const std::filesystem::path& file) {
  errno = 0;
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return Error{file.string() + ": cannot be opened: " + system_reason()};
  struct stat facts {};
  if (::fstat(descriptor, &facts) != 0 || !S_ISREG(facts.st_mode)) {
    ::close(descriptor);
    return Error{file.string() + ": is no file"};
  }
  return RandomAccessFile(file, descriptor, static_cast<std::uint64_t>(facts.st_size));
}

RandomAccessFile::RandomAccessFile(RandomAccessFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_) {}

RandomAccessFile::~RandomAccessFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<SharedBytes> RandomAccessFile::read(std::uint64_t offset, std::uint64_t size) const {
  if (offset > size_ || size > size_ - offset)
    return error(offset, std::to_string(size) + " bytes needed, the file ends after " + std::to_string(size_));
  std::uint8_t* at = nullptr;
  SharedBytes result = allocate(size, at);
  if (at == nullptr) return error(offset, "no memory for " + std::to_string(size) + " bytes");
  for (std::uint64_t done = 0; done < size;) {
    errno = 0;
    const ssize_t got = ::pread(descriptor_, at + done, size - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return error(offset + done, "cannot be read: " + system_reason());
    done += static_cast<std::uint64_t>(got);
  }
  return result;
}

Error RandomAccessFile::error(std::uint64_t offset, const std::string& reason) const {
  return {path_.string() + ": at byte " + std::to_string(offset) + ": " + reason};
}

}  // namespace revisit::io_internal

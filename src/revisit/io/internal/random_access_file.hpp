// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit::io_internal {

using ByteSpan = std::span<const std::uint8_t>;

/// Bytes that stay alive as long as someone holds them: a decompressed chunk, and the messages in it.
struct SharedBytes {
  std::shared_ptr<const std::uint8_t[]> owner;
  ByteSpan bytes;
  SharedBytes part(std::size_t offset, std::size_t size) const { return {owner, bytes.subspan(offset, size)}; }
};
/// Room for `size` bytes, not yet touched: a size that lies costs no memory. `writable` is null where there is none.
SharedBytes allocate(std::size_t size, std::uint8_t*& writable);

/// A file of any size, read in pieces. Reading is safe from several threads.
class RandomAccessFile {
 public:
  static Result<RandomAccessFile> open(const std::filesystem::path& file);
  ~RandomAccessFile();
  RandomAccessFile(RandomAccessFile&& other) noexcept;
  RandomAccessFile& operator=(RandomAccessFile&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  /// All of [offset, offset + size), or an error that names the file.
  Result<SharedBytes> read(std::uint64_t offset, std::uint64_t size) const;
  /// "FILE: at byte 123: reason".
  Error error(std::uint64_t offset, const std::string& reason) const;

 private:
  RandomAccessFile(std::filesystem::path path, int descriptor, std::uint64_t size)
      : path_(std::move(path)), descriptor_(descriptor), size_(size) {}
  std::filesystem::path path_;
  int descriptor_;
  std::uint64_t size_;
};

}  // namespace revisit::io_internal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstring>
#include <string_view>
#include <type_traits>

#include <revisit/io/internal/random_access_file.hpp>

namespace revisit::io_internal {

static_assert(std::endian::native == std::endian::little, "values in files are copied as they stand");

/// A number at `at`, whatever its alignment; with its bytes reversed where the file is big-endian.
template <typename T>
T load_number(const std::uint8_t* at, bool is_big_endian = false) {
  std::uint8_t bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
  if (is_big_endian)
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(bytes[i], bytes[sizeof(T) - 1 - i]);
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

/// Takes values from bytes, one after the other. What goes beyond the end gives 0 or nothing, and is remembered.
class ByteCursor {
 public:
  explicit ByteCursor(ByteSpan bytes) : bytes_(bytes) {}

  template <typename T>
  T number() {
    static_assert(std::is_arithmetic_v<T>);
    const ByteSpan at = take(sizeof(T));
    return at.empty() ? T{} : load_number<T>(at.data());
  }
  ByteSpan take(std::uint64_t size) {
    if (failed_ || size > bytes_.size() - at_) {
      failed_ = true;
      return {};
    }
    at_ += size;
    return bytes_.subspan(at_ - size, size);
  }
  std::string_view text(std::uint64_t size) {
    const ByteSpan at = take(size);
    return {reinterpret_cast<const char*>(at.data()), at.size()};
  }
  /// Preceded by its length as uint32.
  std::string_view text() { return text(number<std::uint32_t>()); }
  ByteSpan block() { return take(number<std::uint32_t>()); }

  std::size_t position() const { return at_; }
  std::size_t left() const { return failed_ ? 0 : bytes_.size() - at_; }
  bool failed() const { return failed_; }

 private:
  ByteSpan bytes_;
  std::size_t at_ = 0;
  bool failed_ = false;
};

}  // namespace revisit::io_internal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace revisit::io_internal {

/// Bytes of a record that is being written, little-endian; lengths as uint32 unless said otherwise.
class ByteBuffer {
 public:
  template <typename T>
  ByteBuffer& number(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    return *this;
  }
  ByteBuffer& text(std::string_view value) { return number(static_cast<std::uint32_t>(value.size())).raw(value); }
  ByteBuffer& raw(std::string_view value) {
    bytes_ += value;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }
  std::size_t size() const { return bytes_.size(); }
  void clear() { bytes_.clear(); }

 private:
  std::string bytes_;
};

}  // namespace revisit::io_internal

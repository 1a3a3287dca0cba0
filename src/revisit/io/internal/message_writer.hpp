// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <revisit/io/internal/message_values.hpp>

namespace revisit::io_internal {

/// Puts the values of a message one behind the other, little-endian.
class MessageWriter {
 public:
  explicit MessageWriter(Serialisation serialisation) : is_cdr_(serialisation == Serialisation::kCdr) {
    if (is_cdr_) bytes_.assign("\0\1\0\0", 4);
  }
  bool is_cdr() const { return is_cdr_; }

  template <typename T>
  void number(T value) {
    if (is_cdr_)
      while (bytes_.size() % sizeof(T) != 4 % sizeof(T)) bytes_ += '\0';
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  void text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size() + (is_cdr_ ? 1 : 0)));
    bytes_ += value;
    if (is_cdr_) bytes_ += '\0';
  }
  void block(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size()));
    bytes_ += value;
  }
  void stamp(std::int64_t time_ns) {
    number(static_cast<std::uint32_t>(time_ns / 1'000'000'000));
    number(static_cast<std::uint32_t>(time_ns % 1'000'000'000));
  }
  void header(std::int64_t stamp_ns, std::string_view frame_id) {
    if (!is_cdr_) number(std::uint32_t{0});  // ROS 1 counts messages
    stamp(stamp_ns);
    text(frame_id);
  }

  const std::string& bytes() const { return bytes_; }

 private:
  bool is_cdr_;
  std::string bytes_;
};

}  // namespace revisit::io_internal

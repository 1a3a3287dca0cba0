// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include <revisit/core/result.hpp>
#include <revisit/io/internal/message_definition.hpp>
#include <revisit/io/internal/random_access_file.hpp>

namespace revisit::io_internal {

enum class Serialisation : std::uint8_t { kRos1, kCdr };

/// Where the values of a message lie in its bytes, by path: "header.stamp.sec", "transforms[0].child_frame_id". An
/// array of numbers is one value. Messages in an array that hold nothing but numbers lie evenly apart: each of their
/// fields is one value too ("points.offset_time"), that of the first message, with the distance to the next.
class MessageValues {
 public:
  struct Value {
    Primitive primitive = Primitive::kUint8;
    std::size_t offset = 0;    ///< in the message
    std::size_t count = 1;     ///< of an array; characters of a text
    std::size_t messages = 1;  ///< in whose array it stands
    std::size_t stride = 0;    ///< bytes from one of these to the next
  };

  /// `bytes` must outlive the values. An error says where the bytes and the definition part.
  static Result<MessageValues> decode(const MessageDefinition& definition, Serialisation serialisation, ByteSpan bytes);

  const Value* find(std::string_view path) const;
  /// The number at the path, or its `index`th one; nothing where there is none.
  std::optional<double> number(std::string_view path, std::size_t index = 0) const;
  std::optional<std::int64_t> integer(std::string_view path) const;
  std::string text(std::string_view path) const;
  /// Bytes of an array of uint8.
  ByteSpan block(std::string_view path) const;
  /// How many messages an array holds.
  std::size_t count(std::string_view path) const;
  /// header.stamp, nanoseconds.
  std::int64_t stamp_ns(std::string_view path = "header.stamp") const;

  ByteSpan bytes() const { return bytes_; }
  bool is_big_endian() const { return is_big_endian_; }

 private:
  class Walk;
  ByteSpan bytes_;
  bool is_big_endian_ = false;
  std::map<std::string, Value, std::less<>> values_;
  std::map<std::string, std::size_t, std::less<>> counts_;
};

/// The number at `at`.
double number_at(Primitive primitive, const std::uint8_t* at, bool is_big_endian);

}  // namespace revisit::io_internal

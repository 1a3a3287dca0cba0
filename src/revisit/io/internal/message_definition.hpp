// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit::io_internal {

enum class Primitive : std::uint8_t {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64,
  kString,
  kNested  ///< a message in the message
};
/// Bytes of one value; 0 for what has no fixed size.
std::size_t size_of(Primitive primitive);

/// What a type of message holds, as its .msg text says it.
class MessageDefinition {
 public:
  struct Field {
    std::string name;
    Primitive primitive = Primitive::kNested;
    std::size_t nested = 0;  ///< index of the type in types()
    enum class Repeat : std::uint8_t { kOnce, kFixed, kSequence } repeat = Repeat::kOnce;
    std::size_t count = 1;  ///< of a fixed array
  };
  struct Type {
    std::string name;
    std::vector<Field> fields;
  };

  /// `text`: the fields of `type`, then those of every type within it behind a line of '=' and one "MSG: NAME", as bags
  /// embed them. Types of time need none.
  static Result<MessageDefinition> parse(std::string_view type, std::string_view text);

  const std::vector<Type>& types() const { return types_; }  ///< the message's own comes first

 private:
  std::vector<Type> types_;
};

/// "sensor_msgs/msg/PointCloud2" and "sensor_msgs/PointCloud2" are the same.
std::string short_type(std::string_view type);

/// The definition of a type that revisit reads; empty for others. Bags of ROS 2 often embed none.
std::string known_definition(std::string_view short_type, bool is_ros1);
const std::vector<std::string>& known_types();

}  // namespace revisit::io_internal

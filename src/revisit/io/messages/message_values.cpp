// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/message_values.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <revisit/io/internal/byte_cursor.hpp>

namespace revisit::io_internal {

// Goes through the bytes as the definition says. CDR aligns each number to its own size, counted from behind its head
// of four bytes; ROS 1 packs them.
class MessageValues::Walk {
 public:
  Walk(const MessageDefinition& definition, bool is_cdr, MessageValues& values)
      : definition_(definition),
        is_cdr_(is_cdr),
        values_(values),
        target_(&values.values_),
        at_(is_cdr ? kCdrHead : 0) {}

  Status run() {
    message(0, "", 0);
    if (!problem_.empty()) return Error{problem_};
    return ok();
  }

  static constexpr std::size_t kCdrHead = 4;

 private:
  using Field = MessageDefinition::Field;
  using Values = std::map<std::string, Value, std::less<>>;
  static constexpr int kDeepest = 20;
  static constexpr std::size_t kMostMessages = 100'000;  // in one, that do not hold numbers alone

  void fail(const std::string& path, const std::string& reason) {
    if (problem_.empty())
      problem_ = "field '" + path + "' at byte " + std::to_string(at_) + " of " +
                 std::to_string(values_.bytes_.size()) + ": " + reason;
  }
  void align(std::size_t size) {
    if (is_cdr_) at_ = kCdrHead + (at_ - kCdrHead + size - 1) / size * size;
  }
  bool take(const std::string& path, std::size_t count, std::size_t size) {
    const std::size_t end = values_.bytes_.size();
    if (at_ > end || (size > 0 && count > (end - at_) / size)) {
      fail(path, "the message ends before");
      return false;
    }
    at_ += count * size;
    return true;
  }
  std::size_t length(const std::string& path) {
    align(4);
    if (!take(path, 1, 4)) return 0;
    return load_number<std::uint32_t>(values_.bytes_.data() + at_ - 4, values_.is_big_endian_);
  }

  void message(std::size_t type, const std::string& prefix, int depth) {
    if (depth > kDeepest || ++messages_ > kMostMessages) return fail(prefix, "too many messages within the message");
    const auto& fields = definition_.types()[type].fields;
    if (fields.empty() && is_cdr_) take(prefix, 1, 1);  // ROS 2 puts a byte where nothing is
    for (const Field& field : fields) {
      if (!problem_.empty()) return;
      const std::string path = prefix.empty() ? field.name : prefix + "." + field.name;
      const std::size_t count = field.repeat == Field::Repeat::kSequence ? length(path) : field.count;
      if (field.repeat == Field::Repeat::kOnce && field.primitive == Primitive::kNested)
        message(field.nested, path, depth + 1);
      else if (field.primitive == Primitive::kNested)
        messages(field, path, count, depth);
      else if (field.primitive == Primitive::kString)
        strings(path, count, field.repeat == Field::Repeat::kOnce);
      else
        numbers(field.primitive, path, count);
    }
  }

  bool has_room(const std::string& path) {
    constexpr std::size_t kMostValues = 1'000'000;
    if (++noted_ <= kMostValues) return true;
    fail(path, "too many values in the message");
    return false;
  }

  void numbers(Primitive primitive, const std::string& path, std::size_t count) {
    const std::size_t size = size_of(primitive);
    if (count > 0) align(size);
    const std::size_t begin = at_;
    if (take(path, count, size) && has_room(path)) (*target_)[path] = {primitive, begin, count};
  }

  void strings(const std::string& path, std::size_t count, bool is_one) {
    for (std::size_t i = 0; i < count && problem_.empty(); ++i) {
      const std::size_t size = length(path);
      const std::size_t begin = at_;
      if (take(path, size, 1) && is_one && has_room(path)) (*target_)[path] = {Primitive::kString, begin, size};
    }
  }

  bool holds_numbers_alone(std::size_t type) {
    const auto [known, is_new] = numbers_alone_.emplace(type, false);  // what holds itself does not
    if (!is_new) return known->second;
    const auto& fields = definition_.types()[type].fields;
    return numbers_alone_[type] = std::all_of(fields.begin(), fields.end(), [&](const Field& field) {
             if (field.repeat == Field::Repeat::kSequence || field.primitive == Primitive::kString) return false;
             return field.primitive != Primitive::kNested ||
                    (field.repeat == Field::Repeat::kOnce && holds_numbers_alone(field.nested));
           });
  }

  void messages(const Field& field, const std::string& path, std::size_t count, int depth) {
    values_.counts_[path] = count;
    if (count == 0) return;
    if (!holds_numbers_alone(field.nested)) {
      for (std::size_t i = 0; i < count && problem_.empty(); ++i)
        message(field.nested, path + "[" + std::to_string(i) + "]", depth + 1);
      return;
    }
    // The first one shows where its values lie, the second one how far it is from one to the next.
    Values first, second;
    Values* const outer = std::exchange(target_, &first);
    message(field.nested, path, depth + 1);
    const std::size_t end_of_first = at_;
    target_ = &second;
    if (count > 1) message(field.nested, path, depth + 1);
    target_ = outer;
    const std::size_t stride = at_ - end_of_first;
    if (stride % largest(field.nested) != 0 && is_cdr_ && count > 2)
      return fail(path, "its messages are not evenly apart");
    for (auto& [name, value] : first) {
      value.messages = count;
      value.stride = stride;
    }
    target_->merge(first);
    if (count > 2) take(path, count - 2, stride);
  }

  std::size_t largest(std::size_t type) {
    const auto [known, is_new] = largest_of_.emplace(type, 1);
    if (!is_new) return known->second;
    std::size_t result = 1;
    for (const Field& field : definition_.types()[type].fields)
      result =
          std::max(result, field.primitive == Primitive::kNested ? largest(field.nested) : size_of(field.primitive));
    return largest_of_[type] = result;
  }

  const MessageDefinition& definition_;
  bool is_cdr_;
  MessageValues& values_;
  Values* target_;  ///< where values are noted
  std::size_t at_;
  std::size_t messages_ = 0, noted_ = 0;
  std::map<std::size_t, bool> numbers_alone_;      ///< by type, once it is known
  std::map<std::size_t, std::size_t> largest_of_;  ///< likewise
  std::string problem_;
};

Result<MessageValues> MessageValues::decode(const MessageDefinition& definition, Serialisation serialisation,
                                            ByteSpan bytes) {
  MessageValues values;
  values.bytes_ = bytes;
  if (serialisation == Serialisation::kCdr) {
    if (bytes.size() < Walk::kCdrHead) return Error{definition.types()[0].name + ": the message ends within its head"};
    // Plain CDR, big- or little-endian.
    if (bytes[0] != 0 || bytes[1] > 1)
      return Error{definition.types()[0].name + ": encoding " + std::to_string(bytes[0]) + " " +
                   std::to_string(bytes[1]) + " of the message; allowed: 0 0 and 0 1 (CDR)"};
    values.is_big_endian_ = bytes[1] == 0;
  }
  if (const Status status = Walk(definition, serialisation == Serialisation::kCdr, values).run(); !status)
    return Error{definition.types()[0].name + ": " + status.error().message};
  return values;
}

double number_at(Primitive primitive, const std::uint8_t* at, bool is_big_endian) {
  const auto load = [&]<typename T>(T) { return static_cast<double>(load_number<T>(at, is_big_endian)); };
  switch (primitive) {
    case Primitive::kInt8:
      return load(std::int8_t{});
    case Primitive::kUint8:
      return load(std::uint8_t{});
    case Primitive::kInt16:
      return load(std::int16_t{});
    case Primitive::kUint16:
      return load(std::uint16_t{});
    case Primitive::kInt32:
      return load(std::int32_t{});
    case Primitive::kUint32:
      return load(std::uint32_t{});
    case Primitive::kInt64:
      return load(std::int64_t{});
    case Primitive::kUint64:
      return load(std::uint64_t{});
    case Primitive::kFloat32:
      return load(float{});
    case Primitive::kFloat64:
      return load(double{});
    default:
      return 0.0;
  }
}

const MessageValues::Value* MessageValues::find(std::string_view path) const {
  const auto found = values_.find(path);
  return found == values_.end() ? nullptr : &found->second;
}

std::optional<double> MessageValues::number(std::string_view path, std::size_t index) const {
  const Value* value = find(path);
  if (value == nullptr || value->primitive == Primitive::kString || index >= value->count) return std::nullopt;
  const std::size_t offset = value->offset + index * size_of(value->primitive);
  return number_at(value->primitive, bytes_.data() + offset, is_big_endian_);
}

std::optional<std::int64_t> MessageValues::integer(std::string_view path) const {
  const auto value = number(path);
  if (!value || !(std::abs(*value) < 9e15)) return std::nullopt;
  return static_cast<std::int64_t>(*value);
}

std::string MessageValues::text(std::string_view path) const {
  const Value* value = find(path);
  if (value == nullptr || value->primitive != Primitive::kString) return {};
  std::string text(reinterpret_cast<const char*>(bytes_.data() + value->offset), value->count);
  return text.substr(0, text.find('\0'));  // CDR ends texts with a zero
}

ByteSpan MessageValues::block(std::string_view path) const {
  const Value* value = find(path);
  if (value == nullptr || value->primitive != Primitive::kUint8) return {};
  return bytes_.subspan(value->offset, value->count);
}

std::size_t MessageValues::count(std::string_view path) const {
  const auto found = counts_.find(path);
  return found == counts_.end() ? 0 : found->second;
}

std::int64_t MessageValues::stamp_ns(std::string_view path) const {
  const std::string prefix(path);
  constexpr std::int64_t kFarthest_s = 5'000'000'000;  // as uint32 reaches
  return std::clamp(integer(prefix + ".sec").value_or(0), -kFarthest_s, kFarthest_s) * 1'000'000'000 +
         std::clamp<std::int64_t>(integer(prefix + ".nanosec").value_or(0), 0, 4'294'967'295);
}

}  // namespace revisit::io_internal

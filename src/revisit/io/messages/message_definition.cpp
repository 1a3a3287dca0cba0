// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/message_definition.hpp>

#include <charconv>
#include <map>
#include <optional>

#include <revisit/io/internal/bytes.hpp>

namespace revisit::io_internal {
namespace {

constexpr std::size_t kMostFields = 10'000;

std::optional<Primitive> primitive_of(std::string_view name) {
  static const std::map<std::string_view, Primitive> kNames = {
      {"bool", Primitive::kUint8},      {"byte", Primitive::kUint8},    {"char", Primitive::kUint8},
      {"int8", Primitive::kInt8},       {"uint8", Primitive::kUint8},   {"int16", Primitive::kInt16},
      {"uint16", Primitive::kUint16},   {"int32", Primitive::kInt32},   {"uint32", Primitive::kUint32},
      {"int64", Primitive::kInt64},     {"uint64", Primitive::kUint64}, {"float32", Primitive::kFloat32},
      {"float64", Primitive::kFloat64}, {"string", Primitive::kString}};
  const auto found = kNames.find(name);
  return found == kNames.end() ? std::nullopt : std::optional(found->second);
}

// The fields of one type as they are written: "TYPE NAME", "TYPE[] NAME", "TYPE[3] NAME", with bounds and defaults.
struct Written {
  std::string type, name;
  MessageDefinition::Field::Repeat repeat = MessageDefinition::Field::Repeat::kOnce;
  std::size_t count = 1;
};

std::optional<Written> parse_line(std::string_view line) {
  const std::vector<std::string_view> words = split_words(line.substr(0, line.find('#')));
  if (words.size() < 2) return std::nullopt;
  // Constants have a '=' behind the name, or in it.
  if (words[1].find('=') != std::string_view::npos || (words.size() > 2 && words[2].front() == '='))
    return std::nullopt;
  Written written{std::string(words[0]), std::string(words[1])};
  if (const auto bracket = written.type.find('['); bracket != std::string::npos) {
    const std::string size = written.type.substr(bracket + 1, written.type.find(']') - bracket - 1);
    written.type.resize(bracket);
    const auto parsed = std::from_chars(size.data(), size.data() + size.size(), written.count);
    const bool is_fixed = parsed.ec == std::errc() && !size.empty();
    written.repeat = is_fixed ? MessageDefinition::Field::Repeat::kFixed : MessageDefinition::Field::Repeat::kSequence;
  }
  if (const auto bound = written.type.find("<="); bound != std::string::npos) written.type.resize(bound);
  return written;
}

using Sections = std::map<std::string, std::vector<Written>>;

Sections parse_sections(const std::string& type, std::string_view text) {
  Sections sections;
  std::string section = type;
  sections[section];
  for (const std::string_view line : split_lines(text)) {
    if (line.starts_with("====")) continue;
    if (line.starts_with("MSG: ")) {
      section = short_type(split_words(line).back());
      sections[section].clear();
    } else if (const auto written = parse_line(line)) {
      sections[section].push_back(*written);
    }
  }
  // "time" of ROS 1 and builtin_interfaces/Time of ROS 2 are two numbers, whoever defines them.
  for (const char* name : {"time", "duration", "builtin_interfaces/Time", "builtin_interfaces/Duration"})
    sections[name] = {{std::string(name).ends_with("uration") ? "int32" : "uint32", "sec"}, {"uint32", "nanosec"}};
  return sections;
}

// A type within a package may be named without it.
Sections::const_iterator find_section(const Sections& sections, const std::string& type, const std::string& within) {
  if (type == "Header") return sections.find("std_msgs/Header");
  auto found = sections.find(short_type(type));
  if (found == sections.end()) found = sections.find(within.substr(0, within.find('/') + 1) + type);
  return found;
}

}  // namespace

std::size_t size_of(Primitive primitive) {
  switch (primitive) {
    case Primitive::kInt8:
    case Primitive::kUint8:
      return 1;
    case Primitive::kInt16:
    case Primitive::kUint16:
      return 2;
    case Primitive::kInt32:
    case Primitive::kUint32:
    case Primitive::kFloat32:
      return 4;
    case Primitive::kInt64:
    case Primitive::kUint64:
    case Primitive::kFloat64:
      return 8;
    default:
      return 0;
  }
}

std::string short_type(std::string_view type) {
  const auto middle = type.find("/msg/");
  if (middle == std::string_view::npos) return std::string(type);
  return std::string(type.substr(0, middle + 1)) + std::string(type.substr(middle + 5));
}

Result<MessageDefinition> MessageDefinition::parse(std::string_view type, std::string_view text) {
  const std::string root = short_type(type);
  const Sections sections = parse_sections(root, text);
  MessageDefinition definition;
  std::map<std::string, std::size_t> indices{{root, 0}};
  definition.types_.push_back({root, {}});
  std::size_t fields = 0;
  for (std::size_t i = 0; i < definition.types_.size(); ++i) {
    const std::string name = definition.types_[i].name;
    std::vector<Field> found;
    for (const Written& written : sections.at(name)) {
      if (++fields > kMostFields) return Error{root + ": its definition has more than 10,000 fields"};
      Field field{written.name, Primitive::kNested, 0, written.repeat, written.count};
      if (const auto primitive = primitive_of(written.type)) {
        field.primitive = *primitive;
      } else {
        const auto section = find_section(sections, written.type, name);
        if (section == sections.end())
          return Error{root + ": its definition lacks the type '" + written.type.substr(0, 60) + "' of '" +
                       written.name.substr(0, 60) + "'"};
        const auto [index, is_new] = indices.emplace(section->first, definition.types_.size());
        field.nested = index->second;
        if (is_new) definition.types_.push_back({section->first, {}});
      }
      found.push_back(std::move(field));
    }
    definition.types_[i].fields = std::move(found);
  }
  return definition;
}

}  // namespace revisit::io_internal

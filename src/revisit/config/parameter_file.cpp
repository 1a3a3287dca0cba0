// SPDX-License-Identifier: Apache-2.0
#include <revisit/config/parameter_file.hpp>

#include <algorithm>
#include <sstream>

#define TOML_HEADER_ONLY 1                           // whoever links this library needs no other
#define TOML_ASSERT(condition) static_cast<void>(0)  // it asserts what a file may hold, and then says as an error
#include <toml++/toml.h>

namespace revisit {
namespace {

std::string place(const std::filesystem::path& file, const toml::node& node) {
  return file.string() + ":" + std::to_string(node.source().begin.line) + ": ";
}

std::string as_text(const toml::node& value, bool is_text) {
  if (const auto* string = value.as_string()) return is_text ? string->get() : "'" + string->get() + "'";
  std::ostringstream text;
  value.visit([&](const auto& concrete) { text << concrete; });
  return text.str();
}

bool is_text_parameter(const std::string& name) {
  const auto infos = parameter_infos();
  return std::any_of(infos.begin(), infos.end(), [&](const auto& info) { return info.is_text && info.name == name; });
}

}  // namespace

Result<Parameters> read_parameters(const std::filesystem::path& file, Parameters base) {
  toml::table document;
  try {
    document = toml::parse_file(file.string());
  } catch (const toml::parse_error& problem) {
    if (std::error_code failure; !std::filesystem::is_regular_file(file, failure))
      return Error{file.string() + ": no such file"};
    return Error{file.string() + ":" + std::to_string(problem.source().begin.line) + ": " +
                 std::string(problem.description())};
  }
  for (const auto& [section, body] : document) {
    const toml::table* fields = body.as_table();
    if (fields == nullptr)
      return Error{place(file, body) + "'" + std::string(section.str()) + "' stands outside a [section]"};
    for (const auto& [field, value] : *fields) {
      const std::string name = std::string(section.str()) + "." + std::string(field.str());
      if (is_text_parameter(name) && !value.is_string())
        return Error{place(file, value) + name + " = " + as_text(value, true) +
                     " is not allowed; allowed: a text in quotes"};
      if (const Status status = set_parameter(base, name, as_text(value, is_text_parameter(name))); !status)
        return Error{place(file, value) + status.error().message};
    }
  }
  if (const Status status = validate(base); !status) return Error{file.string() + ": " + status.error().message};
  return base;
}

}  // namespace revisit

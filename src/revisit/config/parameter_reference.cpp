// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <sstream>

#include <revisit/config/parameter_file.hpp>

namespace revisit {
namespace {

std::string section_of(const std::string& name) { return name.substr(0, name.find('.')); }
std::string field_of(const std::string& name) { return name.substr(name.find('.') + 1); }

}  // namespace

// A TOML string; file names may hold anything.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    char code[8];
    if (c == '"' || c == '\\') result += '\\';
    if (static_cast<unsigned char>(c) < 0x20) {
      std::snprintf(code, sizeof code, "\\u%04x", static_cast<unsigned>(c));
      result += code;
    } else {
      result += c;
    }
  }
  return result + "\"";
}

std::string to_toml(const Parameters& parameters, std::string_view only_section) {
  std::ostringstream text;
  std::string section;
  for (const ParameterInfo& info : parameter_infos()) {
    if (!only_section.empty() && section_of(info.name) != only_section) continue;
    if (section_of(info.name) != section) {
      text << (section.empty() ? "" : "\n") << "[" << section_of(info.name) << "]\n";
      section = section_of(info.name);
    }
    text << field_of(info.name) << " = "
         << (info.is_text ? quoted(get_parameter(parameters, info.name)) : get_parameter(parameters, info.name))
         << "  # " << info.help << "\n";
  }
  return text.str();
}

std::string parameter_reference_markdown() {
  std::ostringstream page;
  page
      << "# Parameters\n\n"
         "Made by `revisit parameters --markdown`; do not edit by hand. Each is a flag (`--retrieval.top_k 10`) and a\n"
         "line of a parameter file (`--parameters FILE`, TOML with one table a section). `revisit parameters` prints\n"
         "such a file. The unit stands at the end of the name: `_m` metres, `_s` seconds, `_deg` degrees.\n\n"
         "| parameter | default |";
  const std::vector<std::string> presets = preset_names();
  for (std::size_t i = 1; i < presets.size(); ++i) page << " " << presets[i] << " |";
  page << " allowed | meaning |\n|---|---|";
  for (std::size_t i = 1; i < presets.size(); ++i) page << "---|";
  page << "---|---|\n";
  for (const ParameterInfo& info : parameter_infos()) {
    page << "| `" << info.name << "` | " << info.default_value << " |";
    for (std::size_t i = 1; i < presets.size(); ++i) {
      const std::string value = get_parameter(*preset(presets[i]), info.name);
      page << " " << (value == info.default_value ? "" : value) << " |";
    }
    page << " " << allowed_values(info) << " | " << info.help << " |\n";
  }
  return page.str();
}

}  // namespace revisit

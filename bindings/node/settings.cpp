// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include <revisit/config/parameters.hpp>

#include "node.hpp"

namespace revisit::node {

std::vector<ParameterText> parameters() {
  std::vector<ParameterText> texts;
  for (const ParameterInfo& each : parameter_infos())
    if (!each.name.starts_with("simulation."))
      texts.push_back({each.name, each.help, each.default_value, allowed_values(each)});
  return texts;
}

bool is_setting(const std::string& name) {
  constexpr std::array kOwn{"mode", "map", "resume", "map_frame", "odom_frame", "base_frame", "queue"};
  const std::vector<ParameterInfo>& infos = parameter_infos();
  return std::find(kOwn.begin(), kOwn.end(), name) != kOwn.end() ||
         std::any_of(infos.begin(), infos.end(), [&](const ParameterInfo& each) { return each.name == name; });
}

bool set(Settings& settings, const std::string& name, const std::string& text, std::string& error) {
  const auto refuse = [&](const std::string& allowed) {
    error = name + " is '" + text + "'; allowed: " + allowed;
    return false;
  };
  for (const auto& [known, value] : {std::pair{"mode", &settings.mode},
                                     {"map", &settings.map},
                                     {"map_frame", &settings.map_frame},
                                     {"odom_frame", &settings.odom_frame},
                                     {"base_frame", &settings.base_frame}})
    if (name == known) {
      *value = text;
      return true;
    }
  if (name == "resume") {
    settings.resume = text == "true" || text == "1";
    return settings.resume || text == "false" || text == "0" || refuse("true, false");
  }
  if (name == "queue") {
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), settings.queue);
    return (failure == std::errc() && end == text.data() + text.size() && settings.queue > 0) || refuse("1 and more");
  }
  settings.parameters[name] = text;
  return true;
}

}  // namespace revisit::node

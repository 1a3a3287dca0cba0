// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include <revisit/config/parameters.hpp>

namespace revisit {

/// Reads a TOML file of `[section]` tables over `base`. Unknown keys and values outside their range are errors
/// that name the file and the line.
Result<Parameters> read_parameters(const std::filesystem::path& file, Parameters base = {});

/// The same parameters as a TOML file, each line with its help; of one section if one is named.
std::string to_toml(const Parameters& parameters, std::string_view only_section = {});

/// The reference page docs/parameters.md.
std::string parameter_reference_markdown();

}  // namespace revisit

// SPDX-License-Identifier: Apache-2.0
#include <iostream>
#include <memory>

#include <revisit/config/parameter_file.hpp>

#include "common.hpp"

namespace revisit::cli {

Run add_parameters(CLI::App& program) {
  struct ParametersOptions {
    ParameterFlags parameters;
    bool markdown = false;
  };
  auto options = std::make_shared<ParametersOptions>();
  CLI::App* command = program.add_subcommand(
      "parameters", "Print all parameters as a file for --parameters: of a preset, or as the flags set them.");
  options->parameters.add_to(*command);
  command->add_flag("--markdown", options->markdown, "Print the reference page docs/parameters.md instead");
  return [options]() -> int {
    const auto parameters = options->parameters.resolve();
    if (!parameters) return fail(parameters.error(), kUsage);
    std::cout << (options->markdown ? parameter_reference_markdown() : to_toml(*parameters));
    return kDone;
  };
}

}  // namespace revisit::cli

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include <revisit/core/result.hpp>
#include <revisit/descriptors/baseline.hpp>

namespace revisit {

/// A method from a shared library that exports what baseline_plugin.h says; it stays loaded until the program ends. The
/// error names the file and what is wrong with it. What the library does is not checked: it is code.
Result<std::unique_ptr<Baseline>> load_baseline(const std::filesystem::path& library);

}  // namespace revisit

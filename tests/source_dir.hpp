// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace revisit::testing_support {

/// The project's folder, as it was built.
std::filesystem::path source_dir();

}  // namespace revisit::testing_support

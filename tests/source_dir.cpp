// SPDX-License-Identifier: Apache-2.0
#include "source_dir.hpp"

namespace revisit::testing_support {

std::filesystem::path source_dir() { return REVISIT_SOURCE_DIR; }

}  // namespace revisit::testing_support

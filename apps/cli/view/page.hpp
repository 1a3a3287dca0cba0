// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace revisit::cli {

/// The page of apps/viewer, as it was built; each is empty where the program was built without it.
std::string_view page_html();
std::string_view page_script();
std::string_view page_style();

}  // namespace revisit::cli

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

namespace revisit::cli {

/// Rows of cells, the heads first, so that text and HTML show the same numbers.
using Table = std::vector<std::vector<std::string>>;

std::string to_text(const Table& table);  ///< columns to the right, each as wide as its widest cell
std::string to_html(const Table& table);
std::string to_latex(const Table& table);  ///< a tabular in the style of booktabs
std::string html_escape(const std::string& text);

}  // namespace revisit::cli

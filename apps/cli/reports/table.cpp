// SPDX-License-Identifier: Apache-2.0
#include "reports/table.hpp"

#include <algorithm>

namespace revisit::cli {

std::string to_text(const Table& table) {
  std::string text;
  for (const auto& row : table) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      std::size_t width = 0;
      for (const auto& each : table) width = std::max(width, each[i].size());
      text += std::string(width - row[i].size() + 2, ' ') + row[i];
    }
    text += '\n';
  }
  return text;
}

std::string to_latex(const Table& table) {
  std::string text = "\\begin{tabular}{l" + std::string(table[0].size() - 1, 'r') + "}\n\\toprule\n";
  for (std::size_t r = 0; r < table.size(); ++r) {
    for (std::size_t i = 0; i < table[r].size(); ++i) {
      if (i > 0) text += " & ";
      for (const char c : table[r][i]) text += std::string(c == '_' || c == '%' || c == '&' || c == '#', '\\') + c;
    }
    text += r == 0 ? " \\\\\n\\midrule\n" : " \\\\\n";
  }
  return text + "\\bottomrule\n\\end{tabular}\n";
}

std::string html_escape(const std::string& text) {
  std::string safe;
  for (const char c : text) safe += c == '<' ? "&lt;" : c == '&' ? "&amp;" : std::string(1, c);
  return safe;
}

std::string to_html(const Table& table) {
  std::string html = "<table>\n";
  for (std::size_t r = 0; r < table.size(); ++r) {
    html += "<tr>";
    for (const auto& cell : table[r])
      html += (r == 0 ? "<th>" : "<td>") + html_escape(cell) + (r == 0 ? "</th>" : "</td>");
    html += "</tr>\n";
  }
  return html + "</table>\n";
}

}  // namespace revisit::cli

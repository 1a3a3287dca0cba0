// SPDX-License-Identifier: Apache-2.0
#include "view/view_report.hpp"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "view/page.hpp"
#include "view/view_files.hpp"

namespace revisit::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPartOfScans = 3;  // of all points, one in three is of scans
constexpr std::size_t kPointsAScan = 3000;

std::string to_base64(std::string_view bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = i; k < i + 3; ++k)
      three = three << 8 | (k < bytes.size() ? static_cast<unsigned char>(bytes[k]) : 0u);
    for (int k = 0; k < 4; ++k)
      text += i + static_cast<std::size_t>(k) <= bytes.size() ? kDigits[three >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

// Texts in a page: "</script>" must not end it.
std::string embedded(const nlohmann::json& files) {
  std::string text = files.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace), safe;
  for (const char c : text) safe += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return safe;
}

std::string replaced(std::string text, std::string_view what, std::string_view by) {
  if (const std::size_t at = text.find(what); at != std::string::npos) text.replace(at, what.size(), by);
  return text;
}

// "</script" within the script would end it, too.
std::string inline_script(std::string_view script) {
  std::string text(script);
  for (std::size_t at = text.find("</script"); at != std::string::npos; at = text.find("</script", at + 1))
    text.replace(at, 2, "<\\/");
  return text;
}

// Takes out of a tileset what is not among the files.
void keep_only(const nlohmann::json& files, nlohmann::json& node) {
  if (!node.is_object()) return;
  if (node.contains("content") && !files.contains("a/tiles/" + node["content"].value("uri", ""))) node.erase("content");
  if (!node.contains("children")) return;
  auto children = nlohmann::json::array();
  for (auto& child : node["children"]) {
    keep_only(files, child);
    if (child.contains("content") || child.contains("children")) children.push_back(std::move(child));
  }
  node.erase("children");
  if (!children.empty()) node["children"] = std::move(children);
}

// The coarsest tiles, up to so many bytes.
Status add_tiles(const fs::path& folder, std::size_t most_bytes, nlohmann::json& files) {
  const auto tileset = read_tile(folder, "tileset.json");
  if (!tileset) return ok();
  auto shown = nlohmann::json::parse(*tileset, nullptr, false);
  if (shown.is_discarded()) return Error{(folder / "tileset.json").string() + ": is no JSON"};
  std::error_code failure;
  std::map<std::pair<int, std::string>, std::size_t> by_level;  // the coarsest first
  for (fs::directory_iterator it(folder, failure), end; !failure && it != end; it.increment(failure))
    if (const std::string name = it->path().filename(); name.ends_with(".glb"))
      by_level[{std::atoi(name.c_str()), name}] = it->file_size(failure);
  std::size_t bytes = 0;
  for (const auto& [level_and_name, size] : by_level) {
    if ((bytes += size) > most_bytes) break;
    const auto content = read_tile(folder, level_and_name.second);
    if (content) files["a/tiles/" + level_and_name.second] = to_base64(*content);
  }
  keep_only(files, shown["root"]);
  files["a/tiles/tileset.json"] = shown.dump();
  return ok();
}

// Both scans and both descriptors of loops, up to so many bytes: false loops first, then the least probable.
void add_scans(ResultsView& view, const nlohmann::json& loops, std::size_t most_bytes, nlohmann::json& files) {
  std::vector<std::tuple<bool, double, std::int64_t, std::int64_t>> order;
  for (const auto& loop : loops)
    if (loop.value("accepted", false))
      order.emplace_back(loop.value("right", true), loop.value("probability", 1.0), loop.value("query", std::int64_t{}),
                         loop.value("match", std::int64_t{}));
  std::sort(order.begin(), order.end());
  std::size_t bytes = 0;
  for (const auto& [is_right, probability, query, match] : order)
    for (const std::int64_t frame : {query, match}) {
      if (bytes > most_bytes) return;
      const std::string scan = "a/scans/" + std::to_string(frame) + ".bin";
      if (files.contains(scan)) continue;
      const auto points = view.points(FrameId{frame});
      if (!points) continue;
      std::vector<Point> few;
      for (std::size_t i = 0; i < points->size(); i += 1 + points->size() / kPointsAScan) few.push_back((*points)[i]);
      files[scan] = to_base64(bytes_of_points(few));
      bytes += few.size() * sizeof(Point);
      const auto descriptor = view.descriptor(FrameId{frame});
      if (!descriptor || !*descriptor) continue;
      std::string text = to_json(**descriptor);
      bytes += text.size();
      files["a/descriptors/" + std::to_string(frame) + ".json"] = std::move(text);
    }
}

}  // namespace

Result<std::string> view_report(ResultsView& view, std::size_t most_bytes) try {
  const auto data = view.json();
  if (!data) return data.error();
  nlohmann::json files = {{"a/view.json", *data}, {"views.json", R"({"views":1})"}};
  const std::size_t of_scans = most_bytes / kPartOfScans;
  if (const Status status = add_tiles(view.tiles(), most_bytes - of_scans, files); !status) return status.error();
  add_scans(view, nlohmann::json::parse(*data)["loops"], of_scans, files);
  std::string page(page_html());
  page = replaced(page, R"(<meta charset="utf-8">)",
                  R"(<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; connect-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'">)");
  page = replaced(page, R"(<link rel="stylesheet" href="viewer.css">)",
                  "<style>" + std::string(page_style()) + "</style>");
  page = replaced(page, R"(<script type="module" src="viewer.js"></script>)",
                  "<script type=\"application/json\" id=\"files\">" + embedded(files) +
                      "</script>\n<script type=\"module\">" + inline_script(page_script()) + "</script>");
  return page;
} catch (const nlohmann::json::exception& problem) {
  return Error{(view.tiles() / "tileset.json").string() + ": is no tileset: " + problem.what()};
}

}  // namespace revisit::cli

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <revisit/core/result.hpp>

#include <revisit/evaluation/loop_table.hpp>
#include <revisit/evaluation/retrieval_table.hpp>

#include "pictures/canvas.hpp"

namespace revisit::cli {

/// A line of a chart of precision over recall; the table must outlive it.
struct Curve {
  std::string name;
  const RetrievalTable* table = nullptr;
  Colour colour;
  bool is_dashed = false;
};
Status draw_precision_recall(const std::filesystem::path& file, const std::vector<Curve>& curves);
Status draw_precision_recall(const std::filesystem::path& file, const RetrievalTable& all,
                             const RetrievalTable& reverse);

/// The reference trajectory from above, light to dark as time goes; right loops red below it, false ones black above
/// it, each with a line to its match. `what` they are, for people.
Status draw_trajectory(const std::filesystem::path& file, const Reference& reference, const LoopTable& loops,
                       const std::string& what = "accepted loops");

}  // namespace revisit::cli

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

#include <revisit/core/result.hpp>

#include "view/results_view.hpp"

namespace revisit::cli {

/// A page in one file, to send to a colleague: the view with the coarsest tiles and the scans and descriptors of its
/// loops, thinned; up to `most_bytes` of both together.
Result<std::string> view_report(ResultsView& view, std::size_t most_bytes);

}  // namespace revisit::cli

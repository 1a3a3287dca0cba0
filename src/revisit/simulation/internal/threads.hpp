// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

#include <oneapi/tbb/task_arena.h>

namespace revisit::simulation_internal {

/// As many as wanted (0: all), but no more than there are: oneTBB would print a warning.
inline int threads_to_use(int wanted) {
  const int available = tbb::this_task_arena::max_concurrency();
  return wanted > 0 ? std::min(wanted, available) : available;
}

}  // namespace revisit::simulation_internal

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include <revisit/descriptors/baseline.hpp>

namespace revisit {

/// MapClosures, beside those of make_baselines().
std::unique_ptr<Baseline> make_density_map();

}  // namespace revisit

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <revisit/config/parameters.hpp>
#include <revisit/core/result.hpp>
#include <revisit/io/recording.hpp>
#include <revisit/preprocess/intensity.hpp>

namespace revisit {

/// The intensity scale of a recording that can be read anywhere, from up to ten readable scans spread over it. An error
/// where none of them is readable: the first one's.
Result<IntensityScale> intensity_scale_of(const Recording& recording, const IntensityOptions& options);

}  // namespace revisit

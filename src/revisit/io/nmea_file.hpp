// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include <revisit/core/gps_fix.hpp>
#include <revisit/core/result.hpp>

namespace revisit {

/// The fixes of an NMEA 0183 log, in the order of their times: GGA sentences, with the date of RMC or ZDA and the
/// deviations of GST where there are any. Stamps are UTC, seconds since 1970, or since midnight where no date is given.
/// Lines that are no sentence, or whose checksum is wrong, are left out; an error where there is no fix at all.
Result<std::vector<GpsFix>> read_nmea(const std::filesystem::path& file);

}  // namespace revisit

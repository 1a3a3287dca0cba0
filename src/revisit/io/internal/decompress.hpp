// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include <revisit/core/result.hpp>
#include <revisit/io/internal/random_access_file.hpp>

namespace revisit::io_internal {

/// The largest piece of a bag that is decompressed at once: no chunk and no message comes near.
constexpr std::uint64_t kLargestPiece = std::uint64_t{1} << 31;

/// Undoes "none", "lz4" (frames), "zstd" or "bz2", as bags name them ("" is none). The data must hold exactly `size`
/// bytes. Errors say what is wrong with the data; the caller names the file.
Result<SharedBytes> decompress(std::string_view method, const SharedBytes& data, std::uint64_t size);

/// One zstd frame that says how large it is.
Result<SharedBytes> decompress_zstd(const SharedBytes& data);

/// A whole .zst file into another one, piece by piece.
Status decompress_zstd_file(const RandomAccessFile& file, const std::filesystem::path& target);

}  // namespace revisit::io_internal

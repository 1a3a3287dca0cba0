// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include <revisit/core/image.hpp>

namespace revisit {

/// A corner of an image and what it looks like, whichever way it is turned: ORB (Rublee et al., ICCV 2011).
struct BinaryFeature {
  using Bits = std::array<std::uint64_t, 4>;
  float column = 0.f, row = 0.f;  ///< pixels
  Bits bits{};
};

/// Bits that differ, of 256.
inline int hamming(const BinaryFeature::Bits& a, const BinaryFeature::Bits& b) {
  int different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different += std::popcount(a[i] ^ b[i]);
  return different;
}

struct FeatureOptions {
  int most = 500;
  int levels = 8;      ///< of a pyramid, each 1.2 times as coarse as the one before
  int threshold = 20;  ///< in grey values: how much a corner differs from what is around it
};

/// By OpenCV, the clearest first. Safe from several threads.
std::vector<BinaryFeature> find_features(const Image& image, const FeatureOptions& options);

}  // namespace revisit

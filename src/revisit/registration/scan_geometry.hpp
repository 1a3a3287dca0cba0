// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

/// A scan as registration needs it: its surface, and its features once they are needed. Safe to share between threads.
class ScanGeometry {
 public:
  explicit ScanGeometry(ThinCloud cloud) : surface_(std::move(cloud)) {}
  const SurfaceCloud& surface() const { return surface_; }
  /// Computed on the first call, with that call's radius.
  const Features& features(double radius_m) const {
    std::call_once(*once_, [&] { features_ = compute_features(surface_, radius_m); });
    return features_;
  }

 private:
  SurfaceCloud surface_;
  mutable Features features_;
  std::unique_ptr<std::once_flag> once_ = std::make_unique<std::once_flag>();
};

}  // namespace revisit

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include <revisit/registration/feature_alignment.hpp>
#include <revisit/registration/surface_cloud.hpp>

namespace revisit {

/// A scan as registration needs it: its surface, and its features once they are needed. Safe to share between threads.
class ScanGeometry {
 public:
  explicit ScanGeometry(ThinCloud cloud)
      : before_(cloud.before), surface_(std::make_shared<SurfaceCloud>(std::move(cloud))) {}
  /// The same scan, of which it is now known what was seen before (ThinCloud::before); shares its surface.
  ScanGeometry(const ScanGeometry& alone, std::shared_ptr<const ThinCloud> before)
      : before_(std::move(before)), surface_(alone.surface_) {}
  const SurfaceCloud& surface() const { return *surface_; }
  /// The surface together with what was seen before; the surface alone, where nothing was.
  const SurfaceCloud& widened() const {
    if (!is_widened()) return *surface_;
    std::call_once(*once_widened_, [&] {
      ThinCloud cloud = surface_->cloud();
      cloud.before = before_;
      widened_.emplace(with_before(std::move(cloud)));
    });
    return *widened_;
  }
  bool is_widened() const { return before_ != nullptr; }
  /// Computed on the first call, with that call's radius.
  const Features& features(double radius_m) const {
    std::call_once(*once_, [&] { features_ = compute_features(*surface_, radius_m); });
    return features_;
  }

 private:
  std::shared_ptr<const ThinCloud> before_;
  std::shared_ptr<const SurfaceCloud> surface_;
  mutable std::optional<SurfaceCloud> widened_;
  std::unique_ptr<std::once_flag> once_widened_ = std::make_unique<std::once_flag>();
  mutable Features features_;
  std::unique_ptr<std::once_flag> once_ = std::make_unique<std::once_flag>();
};

}  // namespace revisit

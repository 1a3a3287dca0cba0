// SPDX-License-Identifier: Apache-2.0
#include <revisit/verification/place_clouds.hpp>

#include <algorithm>
#include <map>
#include <string>

namespace revisit {
namespace {

class InMemory final : public PlaceClouds {
 public:
  Status put(FrameId frame, ThinCloud cloud) override {
    clouds_[frame] = std::make_shared<const ThinCloud>(std::move(cloud));
    return ok();
  }
  Result<std::shared_ptr<const ThinCloud>> get(FrameId frame) override {
    const auto found = clouds_.find(frame);
    if (found == clouds_.end()) return Error{"no cloud is kept of frame " + std::to_string(frame.value)};
    return found->second;
  }

 private:
  std::map<FrameId, std::shared_ptr<const ThinCloud>> clouds_;
};

}  // namespace

std::shared_ptr<const ScanGeometry> PlaceGeometries::find(FrameId place) {
  const auto found =
      std::find_if(by_use_.begin(), by_use_.end(), [&](const auto& each) { return each.first == place; });
  if (found == by_use_.end()) return nullptr;
  by_use_.splice(by_use_.begin(), by_use_, found);
  return by_use_.front().second;
}

void PlaceGeometries::keep(FrameId place, std::shared_ptr<const ScanGeometry> geometry) {
  if (by_use_.size() == kKept) by_use_.pop_back();
  by_use_.emplace_front(place, std::move(geometry));
}

std::unique_ptr<PlaceClouds> clouds_in_memory() { return std::make_unique<InMemory>(); }

}  // namespace revisit

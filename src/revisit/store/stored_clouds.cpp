// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_clouds.hpp>

#include <list>
#include <map>
#include <string>

#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

class InStore final : public PlaceClouds {
 public:
  InStore(std::shared_ptr<const MapStore> store, std::size_t kept) : store_(std::move(store)), kept_(kept) {}

  Status put(FrameId frame, ThinCloud cloud) override {
    keep(frame, std::make_shared<const ThinCloud>(std::move(cloud)));
    return ok();
  }

  Result<std::shared_ptr<const ThinCloud>> get(FrameId frame) override {
    if (const auto found = entries_.find(frame); found != entries_.end()) {
      by_use_.splice(by_use_.begin(), by_use_, found->second.use);
      return found->second.cloud;
    }
    const auto bytes = store_->part(frame, MapStore::Part::kPlace);
    if (const auto known = store_->has(frame); !bytes && known && !*known)
      return std::make_shared<const ThinCloud>();  // taken out of the map since: nothing is to be seen there
    if (!bytes) return bytes.error();
    auto cloud = to_thin_cloud(*bytes);
    if (!cloud) return store_->damaged("place", frame);
    return keep(frame, std::make_shared<const ThinCloud>(*std::move(cloud)));
  }

 private:
  struct Entry {
    std::shared_ptr<const ThinCloud> cloud;
    std::list<FrameId>::iterator use;
  };

  std::shared_ptr<const ThinCloud> keep(FrameId frame, std::shared_ptr<const ThinCloud> cloud) {
    if (!by_use_.empty() && entries_.size() >= kept_) {
      entries_.erase(by_use_.back());
      by_use_.pop_back();
    }
    by_use_.push_front(frame);
    entries_[frame] = {cloud, by_use_.begin()};
    return cloud;
  }

  std::shared_ptr<const MapStore> store_;
  std::size_t kept_;
  std::map<FrameId, Entry> entries_;
  std::list<FrameId> by_use_;  ///< the latest first
};

}  // namespace

std::unique_ptr<PlaceClouds> clouds_in_store(std::shared_ptr<const MapStore> store, std::size_t kept) {
  return std::make_unique<InStore>(std::move(store), kept);
}

}  // namespace revisit

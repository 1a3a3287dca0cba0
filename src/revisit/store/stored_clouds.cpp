// SPDX-License-Identifier: Apache-2.0
#include <revisit/store/stored_clouds.hpp>

#include <cstdlib>
#include <filesystem>
#include <list>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <unistd.h>

#include <revisit/store/keyframe_bytes.hpp>

namespace revisit {
namespace {

using SharedCloud = std::shared_ptr<const ThinCloud>;

// The clouds that were used last.
class RecentClouds {
 public:
  explicit RecentClouds(std::size_t kept) : kept_(kept) {}

  SharedCloud find(FrameId frame) {
    const auto found = entries_.find(frame);
    if (found == entries_.end()) return nullptr;
    by_use_.splice(by_use_.begin(), by_use_, found->second.use);
    return found->second.cloud;
  }

  SharedCloud keep(FrameId frame, SharedCloud cloud) {
    if (!by_use_.empty() && entries_.size() >= kept_) {
      entries_.erase(by_use_.back());
      by_use_.pop_back();
    }
    by_use_.push_front(frame);
    entries_[frame] = {cloud, by_use_.begin()};
    return cloud;
  }

 private:
  struct Entry {
    SharedCloud cloud;
    std::list<FrameId>::iterator use;
  };
  std::size_t kept_;
  std::map<FrameId, Entry> entries_;
  std::list<FrameId> by_use_;  ///< the latest first
};

class InStore final : public PlaceClouds {
 public:
  InStore(std::shared_ptr<const MapStore> store, std::size_t kept) : store_(std::move(store)), recent_(kept) {}

  Status put(FrameId frame, ThinCloud cloud) override {
    recent_.keep(frame, std::make_shared<const ThinCloud>(std::move(cloud)));
    return ok();
  }

  Result<SharedCloud> get(FrameId frame) override {
    if (auto known = recent_.find(frame)) return known;
    const auto bytes = store_->part(frame, MapStore::Part::kPlace);
    if (const auto known = store_->has(frame); !bytes && known && !*known)
      return std::make_shared<const ThinCloud>();  // taken out of the map since: nothing is to be seen there
    if (!bytes) return bytes.error();
    auto cloud = to_thin_cloud(*bytes);
    if (!cloud) return store_->damaged("place", frame);
    return recent_.keep(frame, std::make_shared<const ThinCloud>(*std::move(cloud)));
  }

 private:
  std::shared_ptr<const MapStore> store_;
  RecentClouds recent_;
};

class InFile final : public PlaceClouds {
 public:
  explicit InFile(std::size_t kept) : recent_(kept) {
    std::error_code failure;
    std::string name = (std::filesystem::temp_directory_path(failure) / "revisit-XXXXXX").string();
    if (failure) return;
    file_ = mkstemp(name.data());
    if (file_ >= 0) ::unlink(name.c_str());
  }
  InFile(const InFile&) = delete;
  InFile& operator=(const InFile&) = delete;
  ~InFile() override {
    if (file_ >= 0) ::close(file_);
  }

  Status put(FrameId frame, ThinCloud cloud) override {
    const auto shared = std::make_shared<const ThinCloud>(std::move(cloud));
    if (const Bytes bytes = to_bytes(*shared); write(bytes)) {
      spans_[frame] = {end_, bytes.size()};
      end_ += static_cast<off_t>(bytes.size());
      recent_.keep(frame, shared);
    } else {
      for_good_[frame] = shared;
    }
    return ok();
  }

  Result<SharedCloud> get(FrameId frame) override {
    if (auto known = recent_.find(frame)) return known;
    if (const auto found = for_good_.find(frame); found != for_good_.end()) return found->second;
    const auto span = spans_.find(frame);
    if (span == spans_.end()) return Error{"no cloud is kept of frame " + std::to_string(frame.value)};
    Bytes bytes(span->second.size);
    const ssize_t read = ::pread(file_, bytes.data(), bytes.size(), span->second.offset);
    auto cloud = read == static_cast<ssize_t>(bytes.size()) ? to_thin_cloud(bytes) : std::nullopt;
    if (!cloud)
      return Error{"the temporary file with the cloud of frame " + std::to_string(frame.value) + " cannot be read"};
    return recent_.keep(frame, std::make_shared<const ThinCloud>(*std::move(cloud)));
  }

 private:
  bool write(const Bytes& bytes) const {
    return file_ >= 0 && ::pwrite(file_, bytes.data(), bytes.size(), end_) == static_cast<ssize_t>(bytes.size());
  }

  struct Span {
    off_t offset = 0;
    std::size_t size = 0;
  };
  int file_ = -1;
  off_t end_ = 0;
  std::map<FrameId, Span> spans_;
  std::map<FrameId, SharedCloud> for_good_;
  RecentClouds recent_;
};

}  // namespace

std::unique_ptr<PlaceClouds> clouds_in_store(std::shared_ptr<const MapStore> store, std::size_t kept) {
  return std::make_unique<InStore>(std::move(store), kept);
}

std::unique_ptr<PlaceClouds> clouds_in_file(std::size_t kept) { return std::make_unique<InFile>(kept); }

}  // namespace revisit

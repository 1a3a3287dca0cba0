// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <future>

#include <revisit/io/recording.hpp>

namespace revisit::cli {

/// Reads a recording from its scan `first` on, the next one while the caller works on this one.
class ReadAhead {
 public:
  explicit ReadAhead(const Recording& recording, std::size_t first = 0) : recording_(recording), index_(first) {
    start();
  }

  /// The next scan; to be called at most recording.size() - first times.
  Result<Scan> next() {
    Result<Scan> scan = pending_.get();
    start();
    return scan;
  }

 private:
  void start() {
    if (index_ >= recording_.size()) return;
    pending_ = std::async(std::launch::async, [this, i = index_++] { return recording_.read(i); });
  }

  const Recording& recording_;
  std::size_t index_;
  std::future<Result<Scan>> pending_;  // waits for its thread when it goes
};

}  // namespace revisit::cli

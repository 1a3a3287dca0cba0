// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <future>

#include <revisit/io/recording.hpp>

namespace revisit::cli {

/// Reads a recording from its first scan on, the next one while the caller works on this one.
class ReadAhead {
 public:
  explicit ReadAhead(const Recording& recording) : recording_(recording) { start(); }

  /// The next scan; to be called at most recording.size() times.
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
  std::size_t index_ = 0;
  std::future<Result<Scan>> pending_;  // waits for its thread when it goes
};

}  // namespace revisit::cli

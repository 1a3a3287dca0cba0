// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <fstream>
#include <utility>
#include <vector>

#include <unistd.h>

namespace revisit::cli {

/// The memory that the program holds, over the scans: some 200 samples at most, however many scans there are. None
/// where the system does not tell.
class MemoryUse {
 public:
  using Samples = std::vector<std::pair<std::size_t, double>>;  ///< scan, MB

  void after(std::size_t scan) {
    if (scan % every_ != 0) return;
    std::ifstream statm("/proc/self/statm");
    std::size_t all = 0, resident = 0;
    if (!(statm >> all >> resident)) return;
    samples_.emplace_back(scan, static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6);
    if (samples_.size() <= kMost) return;
    every_ *= 2;
    std::erase_if(samples_, [this](const auto& sample) { return sample.first % every_ != 0; });
  }
  const Samples& samples() const { return samples_; }

 private:
  static constexpr std::size_t kMost = 200;
  Samples samples_;
  std::size_t every_ = 1;
};

}  // namespace revisit::cli

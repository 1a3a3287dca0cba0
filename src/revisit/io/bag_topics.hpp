// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <revisit/io/recording.hpp>

namespace revisit {

/// One topic of a bag, or one sender of a packet capture.
struct TopicSummary {
  std::string name, type;
  std::uint64_t messages = 0;
  double rate_hz = 0.0;  ///< 0 where it is not known
  std::string use;       ///< what open_recording() takes it for; empty where it leaves it
};

/// Whether this is a bag (.bag, .mcap, .db3, a folder of them) or a packet capture (.pcap, .pcapng).
bool has_topics(const std::filesystem::path& path);

/// What a bag or a capture holds, and what open_recording() with the same options makes of it.
Result<std::vector<TopicSummary>> list_topics(const std::filesystem::path& path, const RecordingOptions& options = {},
                                              const LogSink& log = {});

}  // namespace revisit

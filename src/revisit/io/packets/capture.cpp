// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/internal/capture.hpp>

#include <algorithm>
#include <cstdio>
#include <map>
#include <mutex>
#include <tuple>

#include <pcap/pcap.h>

#include <revisit/io/internal/byte_cursor.hpp>

namespace revisit::io_internal {
namespace {

std::uint16_t be16(const std::uint8_t* at) { return load_number<std::uint16_t>(at, true); }

// The IPv4 packet in a captured frame; empty for others.
ByteSpan ip_in(int link, ByteSpan frame) {
  std::size_t head = 0;
  if (link == DLT_EN10MB) {
    head = 14;
    while (frame.size() > head && be16(frame.data() + head - 2) == 0x8100) head += 4;  // of virtual networks
    if (frame.size() <= head || be16(frame.data() + head - 2) != 0x0800) return {};
  } else if (link == DLT_LINUX_SLL) {
    head = 16;
  } else if (link == DLT_LINUX_SLL2) {
    head = 20;
  } else if (link == DLT_NULL) {
    head = 4;
  } else if (link != DLT_RAW) {
    return {};
  }
  if (frame.size() < head + 20 || frame[head] >> 4 != 4) return {};
  const std::size_t length = std::min<std::size_t>(be16(frame.data() + head + 2), frame.size() - head);
  return frame.subspan(head, length);
}

struct IpHead {
  std::uint32_t from = 0;
  std::uint16_t id = 0;
  std::size_t fragment_at = 0;
  bool has_more = false, is_udp = false;
  ByteSpan body;
};
IpHead parse_ip(ByteSpan ip) {
  IpHead head;
  const std::size_t size = std::size_t{4} * (ip[0] & 15u);
  if (size < 20 || size > ip.size()) return head;
  const std::uint16_t flags = be16(ip.data() + 6);
  head.from = load_number<std::uint32_t>(ip.data() + 12, true);
  head.id = be16(ip.data() + 4);
  head.fragment_at = std::size_t{8} * (flags & 0x1FFFu);
  head.has_more = (flags & 0x2000) != 0;
  head.is_udp = ip[9] == 17;
  head.body = ip.subspan(size);
  return head;
}

// One capture file, read from the front once, and then at the places that were noted. libpcap knows the formats; where
// it stands in the file is the file's own affair.
class Capture {
 public:
  struct Place {
    std::int64_t time_ns = 0;
    long at = 0;               ///< of the frame in the file
    std::uint32_t frames = 1;  ///< to look through, where the packet came in fragments
  };
  using Key = std::tuple<std::uint32_t, std::uint16_t, std::size_t>;  // sender, port, bytes

  static Result<std::shared_ptr<Capture>> open(const std::filesystem::path& file) {
    char reason[PCAP_ERRBUF_SIZE] = "";
    std::FILE* stream = std::fopen(file.c_str(), "rb");
    if (stream == nullptr) return Error{file.string() + ": cannot be opened"};
    pcap_t* handle = pcap_fopen_offline_with_tstamp_precision(stream, PCAP_TSTAMP_PRECISION_NANO, reason);
    if (handle == nullptr) {
      std::fclose(stream);
      return Error{file.string() + ": is no capture of packets: " + reason};
    }
    return std::shared_ptr<Capture>(new Capture(file, handle));
  }
  ~Capture() { pcap_close(handle_); }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  struct Found {
    Packet packet;
    Key key;
  };

  /// All packets from the front on. False at the end of `use`'s patience.
  Status visit(const std::function<void(const Place&, const Found&)>& use, const LogSink& log) {
    std::map<std::pair<std::uint32_t, std::uint16_t>, std::pair<long, std::uint32_t>> begun;  // place and frame number
    std::uint32_t number = 0;
    while (true) {
      const long at = std::ftell(pcap_file(handle_));
      const auto frame = next();
      if (!frame) {
        if (!frame.error().message.empty()) log_to(log, LogLevel::kWarning, frame.error().message);
        return ok();
      }
      ++number;
      if (frame->frame.empty()) continue;
      forget_old_fragments(frame->time_ns);
      const IpHead head = parse_ip(frame->frame);
      if (head.is_udp && (head.has_more || head.fragment_at != 0) && !fragments_.contains({head.from, head.id}))
        begun[{head.from, head.id}] = {at, number};
      if (const auto found = join(head, frame->time_ns)) {
        Place place{found->packet.time_ns, at, 1};
        if (head.fragment_at != 0 || head.has_more) {
          const auto first = begun[{head.from, head.id}];
          place.at = first.first;
          place.frames = number - first.second + 1;
          begun.erase({head.from, head.id});
        }
        use(place, *found);
      }
    }
  }

  Result<Packet> read(const Place& place, const Key& key) {
    const std::lock_guard lock(mutex_);
    fragments_.clear();
    if (std::fseek(pcap_file(handle_), place.at, SEEK_SET) != 0) return Error{file_.string() + ": cannot be read"};
    for (std::uint32_t i = 0; i < place.frames; ++i) {
      const auto frame = next();
      if (!frame) return Error{file_.string() + ": ended while it was read"};
      if (frame->frame.empty()) continue;
      auto found = join(parse_ip(frame->frame), frame->time_ns);
      if (found && found->key == key && (place.frames == 1 || i + 1 == place.frames)) return std::move(found->packet);
    }
    return Error{file_.string() + ": changed while it was read"};
  }

 private:
  struct Frame {
    std::int64_t time_ns = 0;
    ByteSpan frame;  ///< from the IP head on; empty where it is something else
  };
  struct Fragments {
    std::map<std::size_t, std::vector<std::uint8_t>> parts;
    std::size_t size = 0;  ///< of the whole, once it is known
    std::int64_t begun_ns = 0;
  };

  Capture(std::filesystem::path file, pcap_t* handle)
      : file_(std::move(file)), handle_(handle), link_(pcap_datalink(handle)) {}

  // The next frame; an error without a message at the end.
  Result<Frame> next() {
    pcap_pkthdr* facts = nullptr;
    const u_char* bytes = nullptr;
    const int code = pcap_next_ex(handle_, &facts, &bytes);
    if (code == PCAP_ERROR_BREAK) return Error{};
    if (code != 1) return Error{file_.string() + ": " + pcap_geterr(handle_) + "; packets until there are used"};
    return Frame{std::int64_t{facts->ts.tv_sec} * 1'000'000'000 + facts->ts.tv_usec,
                 ip_in(link_, {bytes, facts->caplen})};
  }

  // Of packets that never became whole: their numbers come round again.
  void forget_old_fragments(std::int64_t time_ns) {
    constexpr std::int64_t kLongest_ns = 1'000'000'000;
    std::erase_if(fragments_, [&](const auto& entry) { return time_ns - entry.second.begun_ns > kLongest_ns; });
  }

  // The UDP packet that is whole with this piece.
  std::optional<Found> join(const IpHead& head, std::int64_t time_ns) {
    if (!head.is_udp) return std::nullopt;
    std::vector<std::uint8_t> joined;
    ByteSpan datagram = head.body;
    if (head.has_more || head.fragment_at != 0) {
      constexpr std::size_t kMostUnfinished = 64;
      if (fragments_.size() > kMostUnfinished) fragments_.clear();
      Fragments& fragments = fragments_[{head.from, head.id}];
      fragments.begun_ns = time_ns;
      fragments.parts[head.fragment_at].assign(head.body.begin(), head.body.end());
      if (!head.has_more) fragments.size = head.fragment_at + head.body.size();
      for (const auto& [at, part] : fragments.parts) {
        if (at != joined.size()) return std::nullopt;
        joined.insert(joined.end(), part.begin(), part.end());
      }
      if (fragments.size == 0 || joined.size() != fragments.size) return std::nullopt;
      fragments_.erase({head.from, head.id});
      datagram = joined;
    }
    constexpr std::size_t kUdpHead = 8;
    if (datagram.size() < kUdpHead) return std::nullopt;
    const std::size_t length = std::min<std::size_t>(be16(datagram.data() + 4), datagram.size());
    if (length <= kUdpHead) return std::nullopt;
    const ByteSpan payload = datagram.subspan(kUdpHead, length - kUdpHead);
    std::uint8_t* target = nullptr;
    Packet packet{time_ns, allocate(payload.size(), target)};
    std::copy(payload.begin(), payload.end(), target);
    return Found{std::move(packet), {head.from, be16(datagram.data() + 2), payload.size()}};
  }

  std::filesystem::path file_;
  pcap_t* handle_;
  int link_;
  std::map<std::pair<std::uint32_t, std::uint16_t>, Fragments> fragments_;
  std::mutex mutex_;
};

class CapturedPackets final : public PacketSource {
 public:
  CapturedPackets(std::shared_ptr<Capture> capture, const Capture::Key& key, std::vector<Capture::Place> places)
      : capture_(std::move(capture)), key_(key), places_(std::move(places)) {}
  std::size_t size() const override { return places_.size(); }
  Result<Packet> read(std::size_t index) const override { return capture_->read(places_.at(index), key_); }

 private:
  std::shared_ptr<Capture> capture_;
  Capture::Key key_;
  std::vector<Capture::Place> places_;
};

std::string name_of(const Capture::Key& key) {
  const std::uint32_t from = std::get<0>(key);
  std::string name;
  for (int shift = 24; shift >= 0; shift -= 8) name += std::to_string((from >> shift) & 255) + (shift > 0 ? "." : "");
  return name + " to port " + std::to_string(std::get<1>(key));
}

}  // namespace

Result<std::vector<CapturedStream>> open_capture(const std::filesystem::path& file, const LogSink& log) {
  auto opened = Capture::open(file);
  if (!opened) return opened.error();
  const std::shared_ptr<Capture> capture = *opened;
  struct Stream {
    std::vector<Capture::Place> places;
    Packet first;
  };
  std::map<Capture::Key, Stream> by_key;
  const Status status = capture->visit(
      [&](const Capture::Place& place, const Capture::Found& found) {
        Stream& stream = by_key[found.key];
        if (stream.places.empty()) stream.first = found.packet;
        stream.places.push_back(place);
      },
      log);
  if (!status) return status.error();
  if (by_key.empty()) return Error{file.string() + ": holds no UDP packet over IPv4"};
  std::vector<CapturedStream> streams;
  streams.reserve(by_key.size());
  for (auto& [key, stream] : by_key)
    streams.push_back({name_of(key), std::get<2>(key), std::move(stream.first),
                       std::make_shared<CapturedPackets>(capture, key, std::move(stream.places))});
  std::stable_sort(streams.begin(), streams.end(), [](const CapturedStream& a, const CapturedStream& b) {
    return a.packets->size() * a.payload_bytes > b.packets->size() * b.payload_bytes;
  });
  return streams;
}

}  // namespace revisit::io_internal

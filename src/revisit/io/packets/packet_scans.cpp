// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <revisit/core/stamps.hpp>
#include <revisit/io/internal/scan_source.hpp>

namespace revisit::io_internal {
namespace {

struct Place {  ///< of a part
  std::size_t packet = 0, part = 0;
};

class PacketScans final : public ScanSource {
 public:
  PacketScans(std::shared_ptr<const PacketSource> packets, std::shared_ptr<const PacketDecoder> decoder,
              std::string name)
      : packets_(std::move(packets)), decoder_(std::move(decoder)), name_(std::move(name)) {}

  Status find_cuts() {
    std::optional<std::uint32_t> before;
    for (std::size_t i = 0; i < packets_->size(); ++i) {
      const auto packet = packets_->read(i);
      if (!packet) {  // the scan it belongs to says so, too
        ++unreadable_;
        continue;
      }
      const ByteSpan payload = packet->payload.bytes;
      if (!decoder_->accepts(payload)) continue;
      for (std::size_t part = 0; part < decoder_->parts(); ++part) {
        const std::uint32_t now = decoder_->phase(payload, part);
        if (!before || decoder_->begins_scan(*before, now)) {
          begins_.push_back({i, part});
          received_ns_.push_back(packet->time_ns);
          if (!before) first_offset_ns_ = packet->time_ns - decoder_->time_ns(payload, part);
        } else if (decoder_->is_late(*before, now)) {
          continue;  // the scan goes on
        }
        before = now;
      }
    }
    if (begins_.empty())
      return Error{name_ + ": none of " + std::to_string(packets_->size()) + " packets is from a " +
                   decoder_->sensor()};
    begins_.push_back({packets_->size(), 0});
    leave_out_stubs();
    return ok();
  }

  std::size_t size() const override { return begins_.size() - 1; }
  Result<double> log_time_s(std::size_t index) const override { return to_seconds(received_ns_[index]); }

  Result<double> stamp_s(std::size_t index) const override {
    const Place from = begins_.at(index);
    const auto packet = packets_->read(from.packet);
    if (!packet) return packet.error();
    const std::int64_t sensor_ns = decoder_->time_ns(packet->payload.bytes, from.part);
    return to_seconds(sensor_ns + offset_for(*packet, sensor_ns));
  }

  Result<Scan> read(std::size_t index) const override {
    const Place from = begins_.at(index), to = begins_.at(index + 1);
    PacketPoints points;
    std::optional<std::int64_t> offset_ns;
    for (std::size_t i = from.packet; i <= to.packet && i < packets_->size(); ++i) {
      const auto packet = packets_->read(i);
      if (!packet) return packet.error();
      const ByteSpan payload = packet->payload.bytes;
      if (!decoder_->accepts(payload)) continue;
      const std::size_t first = i == from.packet ? from.part : 0;
      const std::size_t end = i == to.packet ? to.part : decoder_->parts();
      if (first < end && !offset_ns) offset_ns = offset_for(*packet, decoder_->time_ns(payload, first));
      decoder_->decode(payload, first, end, points);
    }
    const std::int64_t period_ns = decoder_->clock_period_ns();
    // The clock may begin again within the scan.
    if (period_ns > 0)
      for (std::int64_t& time : points.times_ns)
        if (time < points.times_ns.front() - period_ns / 2) time += period_ns;
    if (points.scan.points.empty())
      return Error{name_ + ": scan " + std::to_string(index) + ": no point in its packets"};
    Scan scan = finish_scan(std::move(points), offset_ns.value_or(0));
    // The stamp is that of the turn, whether or not something was met there.
    const auto stamp = stamp_s(index);
    if (!stamp) return stamp.error();
    const auto late_s = static_cast<float>(scan.stamp_s - *stamp);
    for (float& time_s : scan.times_s) time_s += late_s;
    scan.stamp_s = *stamp;
    return scan;
  }

  std::vector<std::string> findings() const override {
    std::vector<std::string> lines{
        "packets of a " + decoder_->sensor(),
        "stamps: when the turn began, by the sensor's clock, which is set by when the first packet was received"};
    if (unreadable_ > 0) lines.push_back("packets: " + std::to_string(unreadable_) + " cannot be read");
    return lines;
  }

 private:
  // Between the clocks as at the first packet, but for the periods that have passed since.
  std::int64_t offset_for(const Packet& packet, std::int64_t sensor_ns) const {
    const std::int64_t period_ns = decoder_->clock_period_ns();
    if (period_ns == 0) return first_offset_ns_;
    const std::int64_t late_ns = packet.time_ns - (sensor_ns + first_offset_ns_);
    const std::int64_t half = late_ns >= 0 ? period_ns / 2 : -period_ns / 2;
    return first_offset_ns_ + (late_ns + half) / period_ns * period_ns;
  }

  // The first and the last turn are seldom whole: less than half as long as others, they are none.
  void leave_out_stubs() {
    const auto parts = [&](std::size_t i) {
      return (begins_[i + 1].packet - begins_[i].packet) * decoder_->parts() + begins_[i + 1].part - begins_[i].part;
    };
    if (size() < 3) return;
    std::vector<std::size_t> lengths;
    for (std::size_t i = 0; i < size(); ++i) lengths.push_back(parts(i));
    std::nth_element(lengths.begin(), lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2), lengths.end());
    const std::size_t least = lengths[lengths.size() / 2] / 2;
    if (parts(size() - 1) < least) begins_.pop_back();
    if (parts(0) < least) {
      begins_.erase(begins_.begin());
      received_ns_.erase(received_ns_.begin());
    }
  }

  std::shared_ptr<const PacketSource> packets_;
  std::shared_ptr<const PacketDecoder> decoder_;
  std::string name_;
  std::vector<Place> begins_;  ///< of each scan, and behind the last
  std::vector<std::int64_t> received_ns_;
  std::int64_t first_offset_ns_ = 0;
  std::size_t unreadable_ = 0;
};

class TopicPackets final : public PacketSource {
 public:
  TopicPackets(std::shared_ptr<const Bag> bag, std::size_t topic) : bag_(std::move(bag)), topic_(topic) {}
  std::size_t size() const override { return bag_->topics()[topic_].messages; }
  Result<Packet> read(std::size_t index) const override {
    auto message = bag_->read(topic_, index);
    if (!message) return message.error();
    const auto values = bag_->decode(topic_, *message);
    if (!values) return values.error();
    const ByteSpan payload = values->block("buf");
    return Packet{message->log_time_ns, {message->data.owner, payload}};
  }

 private:
  std::shared_ptr<const Bag> bag_;
  std::size_t topic_;
};

}  // namespace

Scan finish_scan(PacketPoints points, std::int64_t received_minus_sensor_ns) {
  Scan scan = std::move(points.scan);
  if (points.times_ns.empty()) return scan;
  const std::int64_t first_ns = *std::min_element(points.times_ns.begin(), points.times_ns.end());
  scan.stamp_s = to_seconds(first_ns + received_minus_sensor_ns);
  scan.times_s.reserve(points.times_ns.size());
  for (const std::int64_t time_ns : points.times_ns)
    scan.times_s.push_back(1e-9f * static_cast<float>(time_ns - first_ns));
  return scan;
}

Result<std::unique_ptr<ScanSource>> scans_of_packets(std::shared_ptr<const PacketSource> packets,
                                                     std::shared_ptr<const PacketDecoder> decoder,
                                                     const std::string& name) {
  auto scans = std::make_unique<PacketScans>(std::move(packets), std::move(decoder), name);
  if (const Status status = scans->find_cuts(); !status) return status.error();
  return std::unique_ptr<ScanSource>(std::move(scans));
}

std::shared_ptr<const PacketSource> packets_of_topic(std::shared_ptr<const Bag> bag, std::size_t topic) {
  return std::make_shared<TopicPackets>(std::move(bag), topic);
}

}  // namespace revisit::io_internal

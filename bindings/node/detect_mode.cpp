// SPDX-License-Identifier: Apache-2.0
#include <revisit/pipeline/loop_detector.hpp>
#include <revisit/store/stored_clouds.hpp>

#include "mode.hpp"

namespace revisit::node {
namespace {

class DetectMode final : public Mode {
 public:
  DetectMode(const Parameters& parameters, Outlet& outlet, const LogSink& log)
      : outlet_(outlet), detector_(parameters, std::nullopt, {}, log, clouds_in_file()) {}

  Status process(Scan scan, const Moment& moment) override {
    stamps_ns_[scan.frame] = moment.stamp_ns;
    auto detection = detector_.process(std::move(scan));
    if (!detection) return detection.error();
    for (const LoopConstraint& loop : detection->loops()) {
      Moment then = moment;
      then.stamp_ns = stamps_ns_.at(loop.query);
      ++loops_;
      outlet_.send(message_of(loop, then, stamps_ns_.at(loop.match)));
    }
    return ok();
  }
  void set_verification(const Parameters& parameters) override { detector_.set_verification(parameters); }
  std::string state() const override {
    return std::to_string(detector_.index().size()) + " places, " + std::to_string(loops_) + " loops";
  }

 private:
  Outlet& outlet_;
  LoopDetector detector_;
  std::map<FrameId, std::int64_t> stamps_ns_;
  std::size_t loops_ = 0;
};

}  // namespace

std::unique_ptr<Mode> make_detect_mode(const Parameters& parameters, Outlet& outlet, const LogSink& log) {
  return std::make_unique<DetectMode>(parameters, outlet, log);
}

}  // namespace revisit::node

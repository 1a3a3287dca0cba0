// SPDX-License-Identifier: Apache-2.0
#include "methods.hpp"

#include <algorithm>
#include <ctime>
#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/refusal_text.hpp>

namespace revisit::cli {
namespace {

constexpr const char *kOurs = "revisit", *kOurRetrieval = "revisit-retrieval", *kPaper = "isc-paper";

// Milliseconds that this thread has worked: other programs, and other methods beside, do not count. (What the program
// times itself, its search and all of isc-paper, is by the clock on the wall.)
double worked_ms() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

std::size_t bytes_of(const IntensityScanContext& descriptor) {
  return descriptor.intensity.size() + descriptor.occupancy.size() * sizeof(std::uint64_t);
}

template <typename Work>
double time_ms(Work work) {
  const double begin = worked_ms();
  work();
  return worked_ms() - begin;
}

}  // namespace

std::vector<std::string> Methods::names() {
  std::vector<std::string> names{kOurs, kOurRetrieval, kPaper};
  for (const auto& baseline : make_baselines()) names.push_back(baseline->name());
  return names;
}

Method& Methods::add(const std::string& name, const std::string& source) {
  Method& method = *all_.emplace_back(std::make_unique<Method>());
  method.report.name = name;
  method.report.source = source;
  return method;
}

Methods::Methods(const Options& options, const Parameters& parameters, const IntensityScale& scale)
    : front_end_(parameters, scale, {}, {}) {
  const auto is_wanted = [&](const std::string& name) {
    return options.wanted.empty() ||
           std::find(options.wanted.begin(), options.wanted.end(), name) != options.wanted.end();
  };
  const auto places = [&] { return std::make_unique<PlaceRecognition>(parameters, clouds_in_memory()); };
  if (is_wanted(kOurs)) add(kOurs, "this program, with the parameters given").places_ = places();
  if (is_wanted(kOurRetrieval))
    add(kOurRetrieval, "this program's index alone: its first answer, unverified").index_ =
        std::make_unique<PlaceIndex>(parameters.retrieval);
  if (is_wanted(kPaper)) {
    Parameters as_printed = *preset("paper");
    static_cast<ExclusionRule&>(as_printed.retrieval) = parameters.retrieval;
    add(kPaper, "Wang et al., ICRA 2020, as in the paper (preset `paper`)").detector_ =
        std::make_unique<LoopDetector>(as_printed, scale);
  }
  std::size_t most_scans = 0;  // 0: nobody wants more than one
  for (auto& baseline : make_baselines()) {
    if (!is_wanted(baseline->name())) continue;
    Method& method = add(baseline->name(), baseline->source());
    method.report.gives = baseline->gives();
    method.report.scans = baseline->scans();
    if (baseline->scans() > 1) most_scans = std::max(most_scans, baseline->scans());
    method.baseline_ = std::make_unique<BaselineSearch>(std::move(baseline), parameters.retrieval);
    if (!options.verifies_all) continue;
    method.places_ = places();
    method.places_->set_retrieval([&method](const PreparedScan&, std::size_t) {
      return method.row_ && method.row_->match ? std::vector{*method.row_->match} : std::vector<FrameId>{};
    });
  }
  recent_ = RecentScans(most_scans);
  for (auto& method : all_) {
    method->report.is_verified = method->places_ || method->detector_;
    if (!method->baseline_ && method->report.is_verified) method->report.gives = Baseline::Gives::kPose;
  }
}

Status Methods::answer(const Scan& scan) {
  const auto step = front_end_.step(scan);
  if (step) recent_.add(step->scan);
  const TypicalAgreement typical = front_end_.typical().recent();
  std::vector<Status> statuses(all_.size(), ok());
  tbb::parallel_for(std::size_t{0}, all_.size(), [&](std::size_t i) {
    statuses[i] = all_[i]->answer(scan, step ? &step->scan : nullptr, recent_, typical);
  });
  const auto failed = std::find_if(statuses.begin(), statuses.end(), [](const Status& status) { return !status; });
  return failed == statuses.end() ? ok() : *failed;
}

Status Method::open(const std::filesystem::path& folder, ResultWriter::Existing existing) {
  auto writer = ResultWriter::create(folder, existing);
  if (!writer) return writer.error();
  writer_ = *std::move(writer);
  return ok();
}

Status Method::answer(const Scan& raw, const PreparedScan* prepared, const RecentScans& recent,
                      const TypicalAgreement& typical) {
  Status status = ok();
  one_thread_->execute([&] {
    if (detector_) {
      const auto detection = detector_->process(raw);
      if (!detection) return;  // a scan that shows no place has no answer
      report.retrieval_ms += detection->preparation_ms.describe + detection->search_ms;
      report.verification_ms += detection->geometric_ms;  // with temporal_ms
      status = write(*detection, detection->row());
      return;
    }
    if (!prepared) return;
    if (index_) status = search(*prepared);
    if (baseline_) status = retrieve(*prepared, recent);
    if (status && places_) status = recognise(*prepared, typical);
  });
  return status;
}

Status Method::retrieve(const PreparedScan& scan, const RecentScans& recent) {
  const std::size_t scans = baseline_->method().scans();
  const std::vector<Point> together = scans > 1 ? recent.together(scans) : std::vector<Point>{};
  const std::vector<Point>& points = scans > 1 ? together : scan.scan.points;
  std::optional<BaselineSearch::Answer> answer;
  report.retrieval_ms += time_ms([&] {
    answer = baseline_->process({scan.scan.frame, scan.scan.stamp_s}, points, scan.ground_z_m);
  });
  report.bytes_a_place = baseline_->bytes_a_place();
  row_.reset();
  if (!answer) return ok();
  row_ = std::move(answer->row);
  if (row_->match) given_poses.push_back({row_->query, *row_->match, answer->T_match_query});
  return writer_->add(*row_);
}

Status Method::search(const PreparedScan& scan) {
  const FrameTime query{scan.scan.frame, scan.scan.stamp_s};
  Result<std::vector<LoopCandidate>> found = std::vector<LoopCandidate>{};
  report.retrieval_ms +=
      scan.ms.describe + time_ms([&] { found = index_->search(scan.descriptor, index_->searchable(query)); });
  if (!found) return found.error();
  index_->add(query.frame, query.stamp_s, scan.descriptor);
  report.bytes_a_place = bytes_of(scan.descriptor);
  if (found->empty()) return ok();
  CandidateRow row;
  row.query = query.frame;
  row.match = found->front().match;
  row.score = found->front().score();
  row.reason = to_text(Refusal{Refusal::Reason::kNoPose});
  return writer_->add(row);
}

Status Method::recognise(const PreparedScan& scan, const TypicalAgreement& typical) {
  const std::size_t searchable = places_->index().searchable({scan.scan.frame, scan.scan.stamp_s});
  Result<Detection> detection = Detection{};
  const double worked = time_ms([&] { detection = places_->find(scan, searchable, typical); });
  if (!detection) return detection.error();
  if (!baseline_) {
    report.retrieval_ms += scan.ms.describe + detection->search_ms;
    report.bytes_a_place = bytes_of(scan.descriptor);
  }
  report.verification_ms += baseline_ ? worked : std::max(0.0, worked - detection->search_ms);
  const Status written = write(*detection, baseline_ ? std::nullopt : std::optional(detection->row()));
  if (!written) return written;
  return places_->add(scan);
}

Status Method::write(const Detection& detection, const std::optional<CandidateRow>& row) {
  if (detection.searchable_places == 0) return ok();
  if (row)
    if (const Status status = writer_->add(*row); !status) return status;
  if (!detection.loop) return ok();
  if (!baseline_) given_poses.push_back({detection.loop->query, detection.loop->match, detection.loop->T_match_query});
  return writer_->add(*detection.loop);
}

}  // namespace revisit::cli

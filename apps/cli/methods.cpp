// SPDX-License-Identifier: Apache-2.0
#include "methods.hpp"

#include <algorithm>
#include <array>
#include <ctime>
#include <limits>
#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include <revisit/core/refusal_text.hpp>
#include <revisit/core/text.hpp>
#include <revisit/descriptors/baseline_plugin.hpp>
#include <revisit/descriptors/similarity.hpp>
#include <revisit/vision/density_map.hpp>

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

struct VisionRow {
  const char *name, *light;
  bool by_night_first, by_night_then;
};
constexpr std::array kVision{VisionRow{"visual-words", "by day", false, false},
                             VisionRow{"visual-words-night", "by night", true, true},
                             VisionRow{"visual-words-day-night", "first by day, then by night", false, true}};

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

std::vector<std::unique_ptr<Baseline>> all_baselines() {
  auto all = make_baselines();
  all.push_back(make_density_map());
  return all;
}

Result<std::shared_ptr<const Vocabulary>> vocabulary_beside(const SimulatedRecording& recording) {
  constexpr std::size_t kMostImages = 200, kStep = 4;  // of scans that follow each other most is the same
  SimulationOptions options;
  options.world = recording.options().world;
  options.sensor = recording.options().sensor;
  options.difficulty = recording.options().difficulty;
  options.length_m = recording.options().length_m;
  options.seed = recording.options().seed + 1000;
  const auto other = simulate(options);
  if (!other) return Error{"the drive that visual words are learnt from: " + other.error().message};
  const std::size_t wanted = std::min(kMostImages, (*other)->size() / kStep);
  std::vector<Image> images;
  for (std::size_t i = 0; i < wanted; ++i)
    images.push_back(
        (*other)->image(i * (*other)->size() / wanted, i % 2 == 0 ? ImageLight::kDay : ImageLight::kNight));
  return make_vocabulary(images);
}

std::vector<std::string> Methods::names() {
  std::vector<std::string> names{kOurs, kOurRetrieval, kPaper};
  for (const auto& baseline : all_baselines()) names.push_back(baseline->name());
  return names;
}

std::vector<std::string> Methods::vision_names() {
  std::vector<std::string> names;
  names.reserve(kVision.size());
  for (const VisionRow& row : kVision) names.emplace_back(row.name);
  return names;
}

Method& Methods::add(const std::string& name, const std::string& source) {
  Method& method = *all_.emplace_back(std::make_unique<Method>());
  method.report.name = name;
  method.report.source = source;
  return method;
}

bool Methods::Options::wants(const std::string& name) const {
  return wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end();
}

Result<std::unique_ptr<Methods>> Methods::make(const Options& options, const Parameters& parameters,
                                               const IntensityScale& scale) {
  std::vector<std::unique_ptr<Baseline>> baselines = all_baselines();
  std::erase_if(baselines, [&](const auto& each) { return !options.wants(each->name()); });
  std::vector<std::string> taken = names();
  for (const std::string& vision : vision_names()) taken.push_back(vision);
  for (const std::string& plugin : options.plugins) {
    auto loaded = load_baseline(plugin);
    if (!loaded) return loaded.error();
    const std::string name = (*loaded)->name();
    if (std::find(taken.begin(), taken.end(), name) != taken.end())
      return Error{format("%s: its name, %s, is taken", plugin.c_str(), name.c_str())};
    taken.push_back(name);
    baselines.push_back(*std::move(loaded));
  }
  return std::unique_ptr<Methods>(new Methods(options, parameters, scale, std::move(baselines)));
}

Methods::Methods(const Options& options, const Parameters& parameters, const IntensityScale& scale,
                 std::vector<std::unique_ptr<Baseline>> baselines)
    : front_end_(parameters, scale, {}, {}) {
  const auto places = [&] {
    auto recognition = std::make_unique<PlaceRecognition>(parameters, clouds_in_memory());
    recognition->expect_one_drive();
    return recognition;
  };
  if (options.wants(kOurs)) add(kOurs, "this program, with the parameters given").places_ = places();
  if (options.wants(kOurRetrieval))
    add(kOurRetrieval, "this program's index alone: its first answer, unverified").index_ =
        std::make_unique<PlaceIndex>(parameters.retrieval);
  if (options.wants(kPaper)) {
    Parameters as_printed = *preset("paper");
    static_cast<ExclusionRule&>(as_printed.retrieval) = parameters.retrieval;
    add(kPaper, "Wang et al., ICRA 2020, as in the paper (preset `paper`)").detector_ =
        std::make_unique<LoopDetector>(as_printed, scale);
  }
  std::size_t most_scans = 0;  // 0: nobody wants more than one
  for (auto& baseline : baselines) {
    Method& method = add(baseline->name(), baseline->source());
    method.report.gives = baseline->gives();
    method.report.scans = baseline->scans();
    if (baseline->scans() > 1) {
      most_scans = std::max(most_scans, baseline->scans());
      together_[baseline->scans()];
    }
    method.baseline_ = std::make_unique<BaselineSearch>(std::move(baseline), parameters.retrieval);
    if (!options.verifies_all) continue;
    method.places_ = places();
    method.places_->set_retrieval([&method](const PreparedScan&, std::size_t) {
      return method.row_ && method.row_->match ? std::vector{*method.row_->match} : std::vector<FrameId>{};
    });
  }
  recent_ = RecentScans(most_scans);
  camera_ = options.camera;
  if (camera_ != nullptr && options.vocabulary) add_vision(options, parameters.retrieval);
  for (auto& method : all_) {
    method->report.is_verified = method->places_ || method->detector_;
    method->wanted_pairs = options.pairs;
    if (!method->baseline_ && method->report.is_verified) method->report.gives = Baseline::Gives::kPose;
  }
}

void Methods::add_vision(const Options& options, const ExclusionRule& exclusion) {
  for (const VisionRow& row : kVision) {
    if (options.wanted.empty() || !options.wants(row.name)) continue;
    Method& method =
        add(row.name, std::string("Galvez-Lopez and Tardos, T-RO 2012 (DBoW2), of images of a camera, ") + row.light);
    method.words_ = std::make_unique<VisualWords>(options.vocabulary, exclusion);
    looks_.push_back({&method, row.by_night_first, row.by_night_then});
  }
}

Status Methods::look(const FrameTime& frame, std::size_t index) {
  const bool is_second_half = 2 * index >= camera_->size();
  for (const Look& look : looks_) {
    const bool by_night = is_second_half ? look.by_night_then : look.by_night_first;
    const Image image = camera_->image(index, by_night ? ImageLight::kNight : ImageLight::kDay);
    if (const Status status = look.method->answer(frame, image); !status) return status;
  }
  return ok();
}

Status Methods::answer(const Scan& scan, std::size_t index) {
  if (!looks_.empty())
    if (const Status status = look({scan.frame, scan.stamp_s}, index); !status) return status;
  const auto step = front_end_.step(scan);
  if (step) {
    recent_.add(step->scan);
    for (auto& [scans, points] : together_) points = recent_.together(scans);
  }
  const TypicalAgreement typical = front_end_.typical().recent();
  std::vector<Status> statuses(all_.size(), ok());
  tbb::parallel_for(std::size_t{0}, all_.size(), [&](std::size_t i) {
    statuses[i] = all_[i]->answer({scan, step ? &step->scan : nullptr, together_, typical});
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

Status Method::answer(const FrameTime& frame, const Image& image) {
  std::optional<CandidateRow> row;
  report.retrieval_ms += time_ms([&] { row = words_->process(frame, image); });
  report.bytes_a_place = words_->bytes_a_place();
  return row ? writer_->add(*row) : ok();
}

Status Method::answer(const Query& query) {
  Status status = ok();
  one_thread_->execute([&] {
    if (detector_) {
      const auto detection = detector_->process(query.raw);
      if (!detection) return;  // a scan that shows no place has no answer
      report.retrieval_ms += detection->preparation_ms.describe + detection->search_ms;
      report.verification_ms += detection->geometric_ms;  // with temporal_ms
      status = write(*detection, detection->row());
      return;
    }
    if (query.prepared != nullptr) {
      if (index_) status = search(*query.prepared);
      if (baseline_) status = retrieve(query);
    }
    if (wanted_pairs != nullptr && (index_ || baseline_)) score_pairs(query);
    if (query.prepared != nullptr && status && places_) status = recognise(*query.prepared, query.typical);
  });
  return status;
}

// A frame that is no place is like none.
void Method::score_pairs(const Query& query) {
  const auto wanted = wanted_pairs->find(query.raw.frame);
  if (wanted == wanted_pairs->end()) return;
  constexpr double kLeast = -std::numeric_limits<double>::infinity();
  for (const FramePair& pair : wanted->second) {
    const auto alike = query.prepared == nullptr ? std::nullopt : similarity_to(pair.match, *query.prepared);
    pairs.push_back({alike.value_or(kLeast), pair.is_same_place});
  }
}

Status Method::retrieve(const Query& query) {
  const PreparedScan& scan = *query.prepared;
  const std::size_t scans = baseline_->method().scans();
  const std::vector<Point>& points = scans > 1 ? query.together.at(scans) : scan.scan.points;
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

// Of what retrieval alone knows.
std::optional<double> Method::similarity_to(FrameId frame, const PreparedScan& scan) const {
  if (baseline_) return baseline_->similarity_to(frame);
  const auto found = descriptors_.find(frame);
  if (found == descriptors_.end()) return std::nullopt;
  return match_descriptors(scan.descriptor, found->second).score();
}

Status Method::search(const PreparedScan& scan) {
  if (wanted_pairs != nullptr) descriptors_[scan.scan.frame] = scan.descriptor;
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
  const double worked = time_ms([&] {
    detection = places_->find(scan, searchable, typical);
    if (!detection) return;
    auto earlier = places_->follow_back(*detection, scan.trajectory_point, typical);
    if (earlier)
      detection->earlier = *std::move(earlier);
    else
      detection = earlier.error();
  });
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
  for (const LoopConstraint& loop : detection.loops()) {
    if (!baseline_) given_poses.push_back({loop.query, loop.match, loop.T_match_query});
    if (const Status status = writer_->add(loop); !status) return status;
  }
  if (!baseline_)
    for (const Detection& each : detection.earlier) writer_->replace(each.row());
  return ok();
}

}  // namespace revisit::cli

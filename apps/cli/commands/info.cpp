// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <memory>
#include <vector>

#include <revisit/core/text.hpp>
#include <revisit/io/bag_topics.hpp>
#include <revisit/io/scan_file.hpp>
#include <revisit/pipeline/prepare.hpp>
#include <revisit/pipeline/recording_scale.hpp>
#include <revisit/preprocess/rings.hpp>

#include "common.hpp"
#include "reports/statistics.hpp"
#include "sensor_guess.hpp"

namespace revisit::cli {
namespace {

struct InfoOptions {
  std::string input, beside, picture;
  bool check = false;
  InputFlags recording;
  ParameterFlags parameters;
};

void print_scan_facts(const Scan& scan, const IntensityScale& scale) {
  const Rings rings = find_rings(scan);
  const SensorGuess sensor = guess_sensor(scan, rings);
  float farthest_m = 0.f;
  for (const Point& p : scan.points) farthest_m = std::max(farthest_m, std::sqrt(p.x * p.x + p.y * p.y + p.z * p.z));
  std::printf("points       %zu usable; dropped: %zu not finite, %zu at (0,0,0)\n", scan.points.size(),
              scan.dropped_non_finite, scan.dropped_at_origin);
  std::printf("sensor       %s\n", sensor.name.c_str());
  if (rings.source == RingSource::kNone)
    std::printf("rings        none found\n");
  else
    std::printf("rings        %zu, %s\n", rings.count(), to_string(rings.source).c_str());
  std::printf("view         %.0f degrees around, %.1f to %.1f degrees up, up to %.1f m\n", sensor.horizontal_deg,
              sensor.lowest_deg, sensor.highest_deg, static_cast<double>(farthest_m));
  std::printf("point times  %s\n", scan.times_s.empty() ? "none" : "yes, within the sweep");
  std::printf("intensity    %.6g to %.6g, median of the positive ones %.6g; %.6g becomes 1\n", scale.min_raw,
              scale.max_raw, scale.median_raw, scale.full_scale);
  if (!scale.warning.empty()) print_log()(LogLevel::kWarning, scale.warning);
}

int info_of_file(const std::string& file, const Parameters& parameters) {
  const auto scan = read_scan(file, print_log());
  if (!scan) return fail(scan.error());
  std::printf("file         %s\n", file.c_str());
  const IntensityScale scale = estimate_intensity_scale(std::span<const Scan>(&*scan, 1), parameters.intensity);
  print_scan_facts(*scan, scale);
  return scale.is_reflectance ? kDone : kDoneWithReservations;
}

std::string short_name(const std::string& input) {
  const std::filesystem::path path = std::filesystem::path(input).lexically_normal();
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

// How its scans look on average, and those of another recording beside them.
int compare(const Recording& recording, const InfoOptions& options, const Parameters& parameters) {
  std::vector<RecordingStatistics> all;
  const auto own = collect_statistics(recording, short_name(options.input), parameters);
  if (!own) return fail(own.error());
  all.push_back(*own);
  if (!options.beside.empty()) {
    const auto opened = open_input(options.beside);
    if (!opened) return fail(opened.error());
    const auto other = collect_statistics(**opened, short_name(options.beside), parameters);
    if (!other) return fail(other.error());
    all.push_back(*other);
  }
  print_statistics(all);
  if (options.picture.empty()) return kDone;
  if (const Status status = draw_statistics(options.picture, all); !status) return fail(status.error());
  std::printf("%s\n", options.picture.c_str());
  return kDone;
}

// The topics of a bag, or the senders of a capture, and what revisit takes them for.
Status print_topics(const std::string& input, const RecordingOptions& options) {
  const auto topics = list_topics(input, options);
  if (!topics) return topics.error();
  std::size_t longest_name = 5, longest_type = 4;
  for (const TopicSummary& topic : *topics) {
    longest_name = std::max(longest_name, topic.name.size());
    longest_type = std::max(longest_type, topic.type.size());
  }
  const auto row = [&](const std::string& name, const std::string& type, const std::string& count,
                       const std::string& rate, const std::string& use) {
    std::printf("%-*s  %-*s  %8s  %8s  %s\n", static_cast<int>(longest_name), name.c_str(),
                static_cast<int>(longest_type), type.c_str(), count.c_str(), rate.c_str(), use.c_str());
  };
  row("topic", "type", "messages", "Hz", "used for");
  for (const TopicSummary& topic : *topics)
    row(topic.name, topic.type, std::to_string(topic.messages),
        topic.rate_hz > 0.0 ? format("%.1f", topic.rate_hz) : "", topic.use.empty() ? "-" : topic.use);
  std::printf("\n");
  return ok();
}

// Gaps and stamps that do not increase, in the first minute.
void print_gaps(const Recording& recording) {
  constexpr std::size_t kMost = 600;
  const std::size_t scans = std::min(recording.size(), kMost);
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < scans; ++i) steps_s.push_back(recording.stamp_s(i) - recording.stamp_s(i - 1));
  if (steps_s.size() < 2) return;
  std::vector<double> sorted = steps_s;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double typical_s = sorted[sorted.size() / 2];
  const auto gaps =
      std::count_if(steps_s.begin(), steps_s.end(), [&](double step_s) { return step_s > 1.5 * typical_s; });
  const auto backwards = std::count_if(steps_s.begin(), steps_s.end(), [](double step_s) { return step_s <= 0.0; });
  if (gaps > 0)
    std::printf("gaps         %td among the first %zu scans, the longest %.2f s\n", gaps, scans,
                *std::max_element(steps_s.begin(), steps_s.end()));
  if (backwards > 0)
    std::printf("stamps       %td of the first %zu are not after the one before (duplicates?)\n", backwards, scans);
}

int info_of_recording(const InfoOptions& options, const Parameters& parameters) {
  const std::string& folder = options.input;
  if (has_topics(folder))
    if (const Status status = print_topics(folder, options.recording.options()); !status) return fail(status.error());
  const auto opened = open_input(folder, options.recording.options());
  if (!opened) return fail(opened.error());
  const Recording& recording = **opened;
  const std::size_t last = recording.size() - 1;
  std::printf("recording    %s (%s)\n", folder.c_str(), recording.kind().c_str());
  std::printf("scans        %zu, frames %lld to %lld\n", recording.size(),
              static_cast<long long>(recording.frame(0).value), static_cast<long long>(recording.frame(last).value));
  const double span_s = recording.stamp_s(last) - recording.stamp_s(0);
  const auto frames = static_cast<double>(recording.frame(last).value - recording.frame(0).value);
  if (!recording.has_times())
    std::printf("rate         unknown: no times; 0.1 s a frame is assumed\n");
  else if (span_s > 0.0)
    std::printf("rate         %.2f Hz, %.1f s long\n", frames / span_s, span_s);
  if (recording.has_times()) print_gaps(recording);
  std::printf("poses        %zu\n", recording.trajectory().entries.size());
  for (const std::string& finding : recording.findings()) {
    const auto colon = finding.find(": ");
    const bool has_head = colon != std::string::npos && colon < 12;
    std::printf("%-12s %s\n", has_head ? finding.substr(0, colon).c_str() : "",
                finding.substr(has_head ? colon + 2 : 0).c_str());
  }

  std::size_t broken = 0;
  std::optional<Scan> first;
  for (std::size_t i = 0; i < recording.size() && !first; ++i) {
    auto scan = recording.read(i);
    if (scan) {
      first = *std::move(scan);
    } else {
      ++broken;
      print_log()(LogLevel::kWarning, scan.error().message);
    }
  }
  if (!first) return fail({folder + ": no scan can be read"});
  std::printf("first scan   frame %lld\n", static_cast<long long>(first->frame.value));
  const auto scale = intensity_scale_of(recording, parameters.intensity);
  if (!scale) return fail(scale.error());
  print_scan_facts(*first, *scale);
  if (!options.picture.empty() || !options.beside.empty())
    if (const int code = compare(recording, options, parameters); code != kDone) return code;
  return broken == 0 && scale->is_reflectance ? kDone : kDoneWithReservations;
}

}  // namespace

Run add_info(CLI::App& program) {
  auto options = std::make_shared<InfoOptions>();
  CLI::App* command = program.add_subcommand(
      "info", "Tell what a recording or a single scan file holds: sensor, rings, rate, intensity, poses.");
  command->footer(
      "Of a bag: its topics, how often messages come, and what each is used for.\n\n"
      "Example: revisit info drive.bag; revisit info kitti/sequences/00; revisit info cloud.pcd\n"
      "         revisit info drive --beside kitti/sequences/00 --picture statistics.png");
  command->add_option("input", options->input, "Recording, scan file, or map")->required();
  command->add_option("--picture", options->picture, "Draw how the scans look on average into this .png");
  command->add_flag("--check", options->check, "Of a map: read all of it, and say whether it is as it was written");
  command->add_option("--beside", options->beside, "Another recording to compare with");
  options->recording.add_to(*command);
  options->parameters.add_to(*command, {"preprocess", "intensity", "descriptor"});
  return [options]() -> int {
    const auto parameters = options->parameters.resolve();
    if (!parameters) return fail(parameters.error(), kUsage);
    if (is_map(options->input)) return info_of_map(options->input, options->check);
    if (!options->picture.empty())
      if (const Status status = check_output(options->picture, ".png"); !status) return fail(status.error(), kUsage);
    const bool is_one = !is_recording(options->input);
    if (is_one && !(options->picture.empty() && options->beside.empty()))
      return fail({options->input + ": --picture and --beside need a recording, not a single scan"}, kUsage);
    return is_one ? info_of_file(options->input, *parameters) : info_of_recording(*options, *parameters);
  };
}

}  // namespace revisit::cli

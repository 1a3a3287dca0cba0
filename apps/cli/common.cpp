// SPDX-License-Identifier: Apache-2.0
#include "common.hpp"

#include <algorithm>
#include <csignal>

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <revisit/config/parameter_file.hpp>
#include <revisit/core/text.hpp>
#include <revisit/io/bag_topics.hpp>
#include <revisit/io/calibration_file.hpp>
#include <revisit/simulation/simulated_recording.hpp>
#include <revisit/store/map_store.hpp>

namespace revisit::cli {
namespace {

volatile std::sig_atomic_t interrupt_seen = 0;

void on_interrupt(int signal) {
  interrupt_seen = 1;
  std::signal(signal, SIG_DFL);
}

spdlog::logger& logger() {
  static const auto instance = [] {
    auto log = spdlog::stderr_color_mt("revisit");
    log->set_pattern("%^%l%$: %v");
    return log;
  }();
  return *instance;
}

// A trajectory in it is named as seen from the file.
Result<Parameters> read_parameter_file(const std::string& file, const Parameters& base) {
  auto parameters = read_parameters(file, base);
  if (!parameters) return parameters;
  std::string& trajectory = parameters->simulation.trajectory;
  if (!trajectory.empty() && trajectory != base.simulation.trajectory)
    trajectory = (std::filesystem::path(file).parent_path() / trajectory).lexically_normal().string();
  return parameters;
}

}  // namespace

void ParameterFlags::add_to(CLI::App& command, const std::vector<std::string>& sections, Names names) {
  std::string presets;
  for (const auto& name : preset_names()) presets += (presets.empty() ? "" : ", ") + name;
  command.add_option("--preset", preset_, "Parameters to start from: " + presets)->capture_default_str();
  command.add_option("--parameters", file_,
                     "TOML file of parameters, over the preset (`revisit parameters` prints one)");
  for (const ParameterInfo& info : parameter_infos()) {
    const std::string section = info.name.substr(0, info.name.find('.'));
    const bool is_named = std::find(sections.begin(), sections.end(), section) != sections.end();
    if (sections.empty() ? section == "simulation" : !is_named) continue;
    command
        .add_option_function<std::string>(
            "--" + (names == Names::kShort ? info.name.substr(section.size() + 1) : info.name),
            [this, name = info.name](const std::string& value) { values_[name] = value; },
            info.help + " [" + info.default_value + "; " + allowed_values(info) + "]")
        ->type_name("")
        ->group("Parameters [default; allowed], over the file");
  }
}

Result<Parameters> ParameterFlags::resolve() const {
  auto parameters = preset(preset_);
  if (parameters && !file_.empty()) parameters = read_parameter_file(file_, *parameters);
  if (!parameters) return parameters;
  for (const auto& [name, value] : values_)
    if (const Status status = set_parameter(*parameters, name, value); !status)
      return Error{"--" + name + ": " + status.error().message};
  if (const Status status = validate(*parameters); !status) return status.error();
  return parameters;
}

void InputFlags::add_to(CLI::App& command) {
  const std::string group = "Bags and packet captures";
  command.add_option("--topic", options_.topic, "Topic of the scans or packets, where there are several")->group(group);
  command
      .add_option("--odometry-topic", options_.odometry_topic,
                  "Topic of wheel or other odometry, where there are several; none: without")
      ->group(group);
  command.add_flag("--no-imu", without_imu_, "Leave an IMU out")->group(group);
  command
      .add_option("--sensor", sensor_file_,
                  "JSON that describes the Ouster sensor, where neither the bag nor a file beside it does")
      ->group(group);
  command.add_flag("--last-return", options_.last_return, "Of dual returns, take the last instead of the strongest")
      ->group(group);
}

RecordingOptions InputFlags::options(const std::string& poses_file) const {
  RecordingOptions options = options_;
  options.poses_file = poses_file;
  options.sensor_file = sensor_file_;
  options.use_imu = !without_imu_;
  return options;
}

std::string InputFlags::text() const {
  std::string text;
  if (!options_.topic.empty()) text += " topic=" + options_.topic;
  if (!options_.odometry_topic.empty()) text += " odometry_topic=" + options_.odometry_topic;
  if (without_imu_) text += " no_imu";
  if (options_.last_return) text += " last_return";
  return text;
}

bool is_map(const std::filesystem::path& input) {
  std::error_code failure;
  const std::filesystem::path file = MapStore::file_of(input);
  const bool is_in_folder = file != input;
  return std::filesystem::is_regular_file(file, failure) &&
         (is_in_folder || file.extension() == ".revisit" || file.extension() == ".sqlite");
}

bool is_recording(const std::string& input) {
  std::error_code failure;
  return std::filesystem::is_directory(input, failure) || std::filesystem::path(input).extension() == ".toml" ||
         has_topics(input);
}

namespace {

// Where the recording is known to need it, and nobody has said otherwise.
void correct_elevations(const Recording& recording, PreprocessOptions& preprocess) {
  const double offset_deg = recording.elevation_offset_deg();
  if (offset_deg == 0.0 || preprocess.elevation_offset_deg != 0.0) return;
  preprocess.elevation_offset_deg = offset_deg;
  print_log()(LogLevel::kInfo,
              format("the sensor of this %s gives elevations %.3f degrees too low: corrected; another value: "
                     "--preprocess.elevation_offset_deg",
                     recording.kind().c_str(), offset_deg));
}

}  // namespace

Result<std::unique_ptr<Recording>> open_input(const std::string& input, const RecordingOptions& options,
                                              Parameters* parameters) {
  if (std::filesystem::path(input).extension() != ".toml") {
    auto recording = open_recording(input, print_log(), options);
    if (recording && parameters != nullptr) correct_elevations(**recording, parameters->preprocess);
    return recording;
  }
  if (!options.poses_file.empty())
    return Error{options.poses_file.string() + ": a simulated recording has its own, exact poses"};
  const auto described = read_parameter_file(input, {});
  if (!described) return described.error();
  auto recording = simulate(described->simulation, print_log());
  if (!recording) return recording.error();
  if (parameters != nullptr) parameters->simulation = described->simulation;
  return std::unique_ptr<Recording>(*std::move(recording));
}

void use_frames_alone_without_times(const Recording& recording, Parameters& parameters) {
  if (recording.has_times()) return;
  print_log()(
      LogLevel::kInfo,
      "the recording has no times: 0.1 s a frame is assumed, and odometry allows for scans half a second apart; "
      "places fewer than " +
          std::to_string(parameters.retrieval.exclude_frames) +
          " frames before a scan are not searched, whatever their time. If you know the times, put a times.txt beside "
          "the scans: seconds, a line a scan");
  parameters.retrieval.exclude_s = 0.0;
}

Stamps stamps_of(const Recording& recording) {
  Stamps stamps;
  for (std::size_t i = 0; i < recording.size(); ++i) stamps.push_back({recording.frame(i), recording.stamp_s(i)});
  return stamps;
}

Result<IntensityCalibration> load_calibration(const std::string& file) {
  if (file.empty()) return IntensityCalibration{};
  return read_calibration(file);
}

LogSink print_log() {
  return [](LogLevel level, const std::string& message) {
    logger().log(level == LogLevel::kInfo      ? spdlog::level::info
                 : level == LogLevel::kWarning ? spdlog::level::warn
                                               : spdlog::level::err,
                 message);
  };
}

int fail(const Error& error, int code) {
  logger().error(error.message);
  return code;
}

Status check_output(const std::string& file, const std::string& extension) {
  const std::filesystem::path path = file;
  if (!extension.empty() && path.extension() != extension)
    return Error{file + ": is written as " + extension + "; name it so"};
  std::error_code failure;
  const auto folder = path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder, failure)) return Error{folder.string() + ": no such folder"};
  return ok();
}

std::vector<std::string>& program_arguments() {
  static std::vector<std::string> arguments;
  return arguments;
}

void listen_for_interrupt() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  // The terminal was closed: what was found is written. Under nohup it goes on.
  if (std::signal(SIGHUP, on_interrupt) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

bool interrupted() { return interrupt_seen != 0; }

}  // namespace revisit::cli

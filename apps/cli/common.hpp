// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include <revisit/config/parameters.hpp>
#include <revisit/core/intensity_calibration.hpp>
#include <revisit/core/log.hpp>
#include <revisit/core/result.hpp>
#include <revisit/io/recording.hpp>

namespace revisit::cli {

/// What the program returns to the shell; listed in --help.
enum ExitCode : int {
  kDone = 0,
  kFailed = 1,
  kUsage = 2,
  kDoneWithReservations = 3,  ///< finished, but scans were skipped or not tracked, or the intensity is of no use
  kInterrupted = 130,
};

/// A sub-command registers its flags and, if chosen, is run through the returned function.
using Run = std::function<int()>;
Run add_detect(CLI::App& program);
Run add_slam(CLI::App& program);
Run add_localise(CLI::App& program);
Run add_merge(CLI::App& program);
Run add_export(CLI::App& program);
/// `revisit info` of a map.
int info_of_map(const std::string& path, bool check);
Run add_evaluate(CLI::App& program);
Run add_view(CLI::App& program);
Run add_compare(CLI::App& program);
Run add_describe(CLI::App& program);
Run add_calibrate(CLI::App& program);
Run add_info(CLI::App& program);
Run add_parameters(CLI::App& program);
Run add_simulate(CLI::App& program);
Run add_convert(CLI::App& program);

/// The flags that choose parameters: --preset, --parameters FILE, and one flag a parameter, in this order of strength.
class ParameterFlags {
 public:
  enum class Names { kWithSection, kShort };  ///< --simulation.seed or --seed

  /// The parameters of the named sections become flags; where none is named, those of all but the simulation.
  void add_to(CLI::App& command, const std::vector<std::string>& sections = {}, Names names = Names::kWithSection);
  Result<Parameters> resolve() const;

 private:
  std::string preset_ = "default";
  std::string file_;
  std::map<std::string, std::string> values_;
};

/// The flags that say what of a bag or a packet capture is meant.
class InputFlags {
 public:
  void add_to(CLI::App& command);
  RecordingOptions options(const std::string& poses_file = {}) const;
  /// All of them as text: what must stay as it was when a run is continued.
  std::string text() const;

 private:
  RecordingOptions options_;
  std::string sensor_file_;
  bool without_imu_ = false;
};

/// What the commands take as a recording, for their help.
inline constexpr const char* kRecordingHelp =
    "Recording: ROS bag (.bag, .mcap, .db3 or a folder of them), packet capture (.pcap), KITTI folder or raw drive, "
    "folder of scans, or .toml of a simulated drive";

/// Whether a path is a recording, not a single scan.
bool is_recording(const std::string& input);

/// Whether a path is a saved map, or a folder that holds one.
bool is_map(const std::filesystem::path& input);

/// A recording on the disk, or the one that a file of parameters (.toml) describes, simulated while it is read; its
/// options then stand in `parameters`, if given.
Result<std::unique_ptr<Recording>> open_input(const std::string& input, const RecordingOptions& options = {},
                                              Parameters* parameters = nullptr);

/// What stands for the exclusion of the recent past where the recording has no times: frames alone; said once.
void use_frames_alone_without_times(const Recording& recording, Parameters& parameters);

/// Frame and time of each scan.
using Stamps = std::vector<FrameTime>;
Stamps stamps_of(const Recording& recording);

/// The calibration in `file`, or the identity where no file was named.
Result<IntensityCalibration> load_calibration(const std::string& file);

/// Prints to standard error, with the level; the program's LogSink.
LogSink print_log();
/// Prints the error; returns the exit code.
int fail(const Error& error, int code = kFailed);

/// Why the file cannot be the output of a command: another ending than `extension` (if one is required), or a folder
/// that does not exist.
Status check_output(const std::string& file, const std::string& extension);

/// What the shell passed to the program, its own name left out.
std::vector<std::string>& program_arguments();

/// True from the first Ctrl-C on. The second one ends the program at once.
void listen_for_interrupt();
bool interrupted();

}  // namespace revisit::cli

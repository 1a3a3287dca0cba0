// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "messages.hpp"

namespace revisit::node {

/// Where a node's answers go: ROS 1, ROS 2, a test. Called from the node's own thread.
class Outlet {
 public:
  virtual ~Outlet() = default;
  virtual void send(const Loop& loop) = 0;
  virtual void send(const Frame& frame) = 0;
  virtual void send(const MapPose& pose) = 0;
  virtual void send(const Graph& graph) = 0;
  virtual void send(const MapCloud& cloud) = 0;
  virtual void send(const Health& health) = 0;
  /// tf: maps coordinates of `source` into `target` at that time. False where it is not known yet; does not wait.
  virtual bool look_up(const std::string& target, const std::string& source, std::int64_t stamp_ns,
                       Transform3& T_target_source) = 0;
  virtual void log(bool is_warning, const std::string& text) = 0;
};

struct Settings {
  std::string mode = "slam";  ///< detect, slam, localise
  std::string map;            ///< slam: the folder that keeps it (empty: none); localise: a saved map
  bool resume = false;        ///< slam: the map that is there goes on; otherwise a folder that holds one is refused
  std::string map_frame = "map", odom_frame = "odom", base_frame = "base_link";  ///< REP 105
  std::size_t queue = 20;  ///< scans that wait at most; the oldest goes first
  /// Those of the program, by name ("retrieval.top_k"); names() lists them.
  std::map<std::string, std::string> parameters;
};

/// Sets one by its name; names that are none of these are taken for parameters of the program, which make() judges.
/// False with the reason for a value that is not allowed.
bool set(Settings& settings, const std::string& name, const std::string& text, std::string& error);

/// Whether set() knows the name, or the program has a parameter of it.
bool is_setting(const std::string& name);

/// One parameter of the program, as a node declares it.
struct ParameterText {
  std::string name, help, value, allowed;
};
std::vector<ParameterText> parameters();

/// The node, which knows no ROS: messages in, answers out. add() returns at once; scans are worked on by one thread,
/// and where it falls behind the oldest are left out and counted. All functions may be called from any thread.
class Node {
 public:
  /// Null where the settings cannot be served; `error` then says why.
  static std::unique_ptr<Node> make(const Settings& settings, Outlet& outlet, std::string& error);
  virtual ~Node() = default;

  virtual void add(Cloud cloud) = 0;
  virtual void add(const Imu& imu) = 0;
  virtual void add(const Odometry& odometry) = 0;
  virtual void add(const GpsFix& fix) = 0;
  virtual void add(const InitialPose& pose) = 0;

  /// Each waits for the scan at work. False with the reason, else true with what was done.
  virtual bool save_map(const std::string& folder, std::string& message) = 0;
  virtual bool load_map(const std::string& path, std::string& message) = 0;
  virtual bool publish_map(std::string& message) = 0;
  /// Of the settings, parameters that begin with "geometric." or "temporal." may change; the others must be as they
  /// were.
  virtual bool change(const Settings& settings, std::string& message) = 0;
  virtual bool get_map(MapGrid& grid, std::string& message) = 0;
  /// The scans that wait are worked on, and nothing is lost. Later messages are left out.
  virtual bool finish(std::string& message) = 0;
};

}  // namespace revisit::node

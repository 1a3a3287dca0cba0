// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <revisit/core/log.hpp>
#include <revisit/core/loop.hpp>
#include <revisit/core/pose.hpp>
#include <revisit/core/result.hpp>
#include <revisit/core/scan.hpp>

/// What all parts of the Python module share.
namespace revisit::python {

namespace py = pybind11;

/// revisit.Error: what went wrong with data from outside, in the words of the library.
struct OutsideError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <typename T>
T unwrap(Result<T> result) {
  if (!result) throw OutsideError(result.error().message);
  return *std::move(result);
}
inline void unwrap(const Status& status) {
  if (!status) throw OutsideError(status.error().message);
}

/// Without the interpreter's lock. A thread that is still at work when the interpreter has ended waits for the process
/// to end, too: it could neither go on nor be unwound.
class Unlocked {
 public:
  Unlocked() : state_(PyEval_SaveThread()) {}
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;
  ~Unlocked() noexcept(false) {  // Python ends threads that wait for its lock then by unwinding them
    while (has_ended()) std::this_thread::sleep_for(std::chrono::seconds(1));
    PyEval_RestoreThread(state_);
  }
  static bool has_ended() {
#if PY_VERSION_HEX >= 0x030D0000
    return Py_IsFinalizing() != 0;
#else
    return _Py_IsFinalizing() != 0;
#endif
  }

 private:
  PyThreadState* state_;
};

/// An object of the library that belongs to one thread at a time: calls of several threads wait for each other, without
/// the interpreter's lock, so that Python goes on meanwhile. A call from one of its own callbacks is an error.
template <typename T>
class Shared {
 public:
  explicit Shared(T value) : value_(std::move(value)) {}
  template <typename Use>
  auto use(Use use) {
    if (owner_ == std::this_thread::get_id()) throw std::runtime_error("called from one of its own callbacks");
    const Unlocked unlocked;
    const std::lock_guard lock(mutex_);
    const Owned owned(owner_);
    return use(value_);
  }

 private:
  struct Owned {
    explicit Owned(std::atomic<std::thread::id>& owner) : owner_(owner) { owner_ = std::this_thread::get_id(); }
    Owned(const Owned&) = delete;
    Owned& operator=(const Owned&) = delete;
    ~Owned() { owner_ = std::thread::id(); }
    std::atomic<std::thread::id>& owner_;
  };
  std::mutex mutex_;
  std::atomic<std::thread::id> owner_;
  T value_;
};

/// Runs it without the interpreter's lock.
template <typename Work>
auto without_lock(Work work) {
  const Unlocked unlocked;
  return work();
}

/// To Python's logging, logger "revisit".
LogSink log_sink();
/// For long work: counts done things, and stops it where Python wants to (Ctrl-C, or the callback raised).
class PythonProgress {
 public:
  explicit PythonProgress(py::object callback) : callback_(std::move(callback)) {}
  bool operator()(std::size_t done);
  void rethrow();  ///< what stopped it, once the work has ended

 private:
  py::object callback_;
  std::optional<py::error_already_set> raised_;
};

/// A scan from an array of points: N x 3 or N x 4 of float32 or float64 in any memory order, or structured with named
/// fields as ROS has them. Others, and `intensity`, `time`, `ring` of other lengths, are ValueError. Points that are
/// not finite or (0,0,0) are left out. A Scan is taken as it is.
Scan to_scan(const py::object& points, const py::object& intensity, const py::object& time, const py::object& ring,
             double stamp_s);
/// 4 x 4, or ValueError.
Pose to_pose(const py::object& matrix);
/// Nothing of None.
std::optional<Pose> to_optional_pose(const py::object& matrix);
/// N x 4 x 4.
py::array_t<double> to_array(const std::vector<Pose>& poses);
/// N x 4, float32.
py::array_t<float> to_array(const std::vector<Point>& points);

/// Structured: match, geometry_score, intensity_score, yaw_rad.
py::array to_array(const std::vector<LoopCandidate>& candidates);

void register_dtypes();
void bind_parameters(py::module_& module);
void bind_scans(py::module_& module);
void bind_detection(py::module_& module);
void bind_maps(py::module_& module);
void bind_retrieval(py::module_& module);

}  // namespace revisit::python

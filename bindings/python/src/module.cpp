// SPDX-License-Identifier: Apache-2.0
#include "bind.hpp"

namespace revisit::python {

LogSink log_sink() {
  return [](LogLevel level, const std::string& text) {
    const py::gil_scoped_acquire acquire;
    constexpr int kInfo = 20, kWarning = 30, kError = 40;  // logging.INFO, ...
    const int number = level == LogLevel::kInfo ? kInfo : level == LogLevel::kWarning ? kWarning : kError;
    try {
      py::module_::import("logging").attr("getLogger")("revisit").attr("log")(number, "%s", text);
    } catch (py::error_already_set& error) {
      // The work goes on; where signals are looked for next, Ctrl-C is there once more.
      if (error.matches(PyExc_KeyboardInterrupt))
        PyErr_SetInterrupt();
      else
        error.discard_as_unraisable("revisit's log");
    }
  };
}

bool PythonProgress::operator()(std::size_t done) {
  const py::gil_scoped_acquire acquire;
  try {
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (!callback_.is_none()) callback_(done);
    return true;
  } catch (py::error_already_set& error) {
    raised_ = error;
    return false;
  }
}

void PythonProgress::rethrow() {
  if (raised_) throw py::error_already_set(*std::exchange(raised_, std::nullopt));
}

}  // namespace revisit::python

PYBIND11_MODULE(_core, module) {
  namespace rp = revisit::python;
  module.doc() = "The compiled part of revisit; import revisit.";
  rp::py::register_exception<rp::OutsideError>(module, "Error", PyExc_RuntimeError).doc() =
      "Data from outside that cannot be used: names the file, the value and what is allowed.";
  rp::register_dtypes();
  rp::bind_parameters(module);
  rp::bind_scans(module);
  rp::bind_detection(module);
  rp::bind_maps(module);
  rp::bind_retrieval(module);
  module.attr("__version__") = REVISIT_VERSION;
}

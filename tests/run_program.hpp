// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdio>
#include <string>

#include <sys/wait.h>

namespace revisit::testing_support {

struct Outcome {
  int code = -1;
  std::string output;  // both streams
};

/// Runs a command in a shell.
inline Outcome run_program(const std::string& command) {
  Outcome outcome;
  FILE* pipe = popen(("( " + command + " ) 2>&1 </dev/null").c_str(), "r");
  char buffer[4096];
  while (const std::size_t n = fread(buffer, 1, sizeof buffer, pipe)) outcome.output.append(buffer, n);
  const int status = pclose(pipe);
  outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

#ifdef REVISIT_PROGRAM
/// Runs the program, with `environment` (e.g. "A=1") set.
inline Outcome run(const std::string& arguments, const std::string& environment = "") {
  return run_program(environment + " " + std::string(REVISIT_PROGRAM) + " " + arguments);
}
#endif

}  // namespace revisit::testing_support

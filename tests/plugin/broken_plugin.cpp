// SPDX-License-Identifier: Apache-2.0
// A method for `revisit compare` with one fault, named by the environment.
#include <cmath>
#include <cstdlib>
#include <string>

#include <revisit/descriptors/baseline_plugin.h>

namespace {

std::size_t one_word(const float*, std::size_t, double, std::uint64_t* words, std::size_t) {
  words[0] = 1;
  return 1;
}
// Wants more room each time it is asked.
std::size_t insatiable(const float*, std::size_t, double, std::uint64_t*, std::size_t room) { return room + 1; }
std::size_t huge(const float*, std::size_t, double, std::uint64_t*, std::size_t) { return ~std::size_t{0}; }
std::size_t long_one(const float*, std::size_t, double, std::uint64_t* words, std::size_t room) {
  constexpr std::size_t kWords = 10000;
  for (std::size_t i = 0; i < kWords && room >= kWords; ++i) words[i] = i;
  return kWords;
}
double no_number(revisit_signature, revisit_signature, double* T) {
  if (T != nullptr) T[3] = std::nan("");
  return std::nan("");
}

}  // namespace

extern "C" const revisit_method_v1* revisit_method() {
  static revisit_method_v1 method;
  method = {REVISIT_METHOD_VERSION, "broken", nullptr, REVISIT_GIVES_POSE, 1, 1, one_word, no_number};
  const char* const set = std::getenv("REVISIT_FAULT");
  const std::string fault = set == nullptr ? "" : set;
  if (fault == "null") return nullptr;
  if (fault == "version") method.version = 99;
  if (fault == "name") method.name = "a/../b";
  if (fault == "dots") method.name = "..";
  if (fault == "nameless") method.name = nullptr;
  if (fault == "describe") method.describe = nullptr;
  if (fault == "gives") method.gives = 7;
  if (fault == "scans") method.scans = 0;
  if (fault == "place_every") method.place_every = 0;
  if (fault == "insatiable") method.describe = insatiable;
  if (fault == "huge") method.describe = huge;
  if (fault == "long") method.describe = long_one;
  return &method;
}

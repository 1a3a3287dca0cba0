// SPDX-License-Identifier: Apache-2.0
#include "progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace revisit::cli {

Progress::Progress(std::string what, std::string unit, std::size_t total)
    : what_(std::move(what)),
      unit_(std::move(unit)),
      total_(total),
      is_terminal_(isatty(STDERR_FILENO) != 0),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (is_drawn_) std::fputc('\n', stderr);
}

void Progress::update(std::size_t done) {
  const auto now = std::chrono::steady_clock::now();
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0.0 ? static_cast<double>(done) / seconds : 0.0;
  const double share = total_ == 0 ? 1.0 : static_cast<double>(done) / static_cast<double>(total_);
  const long left_s = rate > 0.0 ? std::lround(static_cast<double>(total_ - done) / rate) : 0L;
  if (!is_terminal_) {
    const auto tenths = static_cast<std::size_t>(share * 10.0);
    if (tenths <= tenths_printed_) return;
    tenths_printed_ = tenths;
    std::fprintf(stderr, "%s: %zu of %zu %s, %.1f a second, %ld:%02ld left\n", what_.c_str(), done, total_,
                 unit_.c_str(), rate, left_s / 60, left_s % 60);
    return;
  }
  using namespace std::chrono_literals;
  if (done < total_ && is_drawn_ && now - last_drawn_ < 100ms) return;
  last_drawn_ = now;
  is_drawn_ = true;
  constexpr int kWidth = 30;
  const int filled = std::clamp(static_cast<int>(share * kWidth), 0, kWidth);
  std::fprintf(stderr, "\r%s [%s%s] %3.0f %%  %zu/%zu  %.1f %s/s  %ld:%02ld left\x1b[K", what_.c_str(),
               std::string(static_cast<std::size_t>(filled), '#').c_str(),
               std::string(static_cast<std::size_t>(kWidth - filled), '.').c_str(), 100.0 * share, done, total_, rate,
               unit_.c_str(), left_s / 60, left_s % 60);
  std::fflush(stderr);
}

void Progress::clear() {
  if (!is_drawn_) return;
  std::fputs("\r\x1b[K", stderr);
  is_drawn_ = false;
}

}  // namespace revisit::cli

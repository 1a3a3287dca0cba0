// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

#include <locale.h>  // newlocale, uselocale: POSIX
#ifdef __APPLE__
#include <xlocale.h>
#endif

#include <revisit/core/ids.hpp>

namespace revisit {

/// As printf, up to 255 characters; numbers with a decimal point, whatever locale the program has set.
[[gnu::format(printf, 1, 2)]] inline std::string format(const char* pattern, ...) {
  static const locale_t plain = newlocale(LC_ALL_MASK, "C", nullptr);
  const locale_t before = uselocale(plain);
  char text[256];
  std::va_list values;
  va_start(values, pattern);
  std::vsnprintf(text, sizeof text, pattern, values);
  va_end(values);
  uselocale(before);
  return text;
}

/// "frame 12", as messages name a scan; "frame 12 of session 2" in a map of several.
inline std::string to_text(FrameId frame) {
  std::string text = "frame " + std::to_string(in_recording(frame).value);
  if (session_of(frame) > 0) text += " of session " + std::to_string(session_of(frame));
  return text;
}

}  // namespace revisit

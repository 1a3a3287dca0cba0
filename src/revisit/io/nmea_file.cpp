// SPDX-License-Identifier: Apache-2.0
#include <revisit/io/nmea_file.hpp>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

namespace revisit {
namespace {

using Fields = std::vector<std::string_view>;

struct Receiver {
  // Horizontal error at a dilution of precision of 1, by the quality that GGA names: 1 GPS, 2 differential, 4 RTK
  // fixed, 5 RTK float; others as the first.
  static double error_m(int quality) { return quality == 2 ? 1.0 : quality == 4 ? 0.02 : quality == 5 ? 0.3 : 3.0; }
  static constexpr double kUpward = 1.7;  ///< heights are worse by so much
};

// What stands between '$' and '*', if the two digits behind are its checksum.
std::optional<std::string_view> payload_of(std::string_view line) {
  const std::size_t begin = line.find('$'), end = line.find('*');
  if (begin == std::string_view::npos || end == std::string_view::npos || end <= begin || line.size() < end + 3)
    return std::nullopt;
  const std::string_view payload = line.substr(begin + 1, end - begin - 1);
  unsigned sum = 0, given = 0;
  for (const char c : payload) sum ^= static_cast<unsigned char>(c);
  const char* const digits = line.data() + end + 1;
  if (std::from_chars(digits, digits + 2, given, 16).ptr != digits + 2 || given != sum) return std::nullopt;
  return payload;
}

Fields split(std::string_view text) {
  Fields fields;
  for (std::size_t begin = 0;;) {
    const std::size_t comma = text.find(',', begin);
    fields.push_back(text.substr(begin, comma - begin));
    if (comma == std::string_view::npos) return fields;
    begin = comma + 1;
  }
}

std::optional<double> number(const Fields& fields, std::size_t i) {
  double value = 0.0;
  if (i >= fields.size() || fields[i].empty()) return std::nullopt;
  const char* const end = fields[i].data() + fields[i].size();
  const auto parsed = std::from_chars(fields[i].data(), end, value);
  if (parsed.ec != std::errc() || parsed.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

// hhmmss.ss to seconds since midnight.
std::optional<double> time_of_day_s(const Fields& fields, std::size_t i) {
  const auto value = number(fields, i);
  if (!value || *value < 0.0 || *value >= 240000.0) return std::nullopt;
  const double hours = std::floor(*value / 1e4), minutes = std::floor(*value / 1e2) - 100.0 * hours;
  return 3600.0 * hours + 60.0 * minutes + (*value - 1e4 * hours - 1e2 * minutes);
}

// dddmm.mmmm and the letter after it to degrees.
std::optional<double> degrees(const Fields& fields, std::size_t i, char negative, double most) {
  const auto value = number(fields, i);
  if (!value || *value < 0.0 || i + 1 >= fields.size() || fields[i + 1].size() != 1) return std::nullopt;
  const double whole = std::floor(*value / 100.0), result = whole + (*value - 100.0 * whole) / 60.0;
  if (result > most) return std::nullopt;
  return fields[i + 1][0] == negative ? -result : result;
}

// Seconds of the beginning of a day since 1970.
std::optional<double> day_s(double day, double month, double year) {
  using namespace std::chrono;
  const year_month_day date{std::chrono::year(static_cast<int>(year)), std::chrono::month(static_cast<unsigned>(month)),
                            std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  return 86400.0 * static_cast<double>(sys_days(date).time_since_epoch().count());
}

class Log {
 public:
  void add(std::string_view payload) {
    const Fields fields = split(payload);
    if (fields[0].size() != 5) return;
    const std::string_view type = fields[0].substr(2);
    if (type == "RMC")
      if (const auto date = number(fields, 9); date && *date >= 0.0)
        begin_day(fields, day_s(std::floor(*date / 1e4), std::fmod(std::floor(*date / 1e2), 100.0),
                                2000.0 + std::fmod(*date, 100.0)));
    if (type == "ZDA") {
      const auto day = number(fields, 2), month = number(fields, 3), year = number(fields, 4);
      if (day && month && year && *day > 0 && *month > 0 && *year > 0) begin_day(fields, day_s(*day, *month, *year));
    }
    if (type == "GST") {
      const auto time_s = time_of_day_s(fields, 1), north_m = number(fields, 6), east_m = number(fields, 7),
                 up_m = number(fields, 8);
      if (time_s && north_m && east_m && up_m && !fixes_.empty() && *time_s == last_time_s_)
        fixes_.back().deviation_m = {*east_m, *north_m, *up_m};
    }
    if (type == "GGA") add_fix(fields);
  }

  std::vector<GpsFix> take() {
    // What came before the first date belongs to the same day.
    if (first_day_s_)
      for (std::size_t i = 0; i < undated_; ++i) fixes_[i].stamp_s += *first_day_s_;
    std::stable_sort(fixes_.begin(), fixes_.end(),
                     [](const GpsFix& a, const GpsFix& b) { return a.stamp_s < b.stamp_s; });
    return std::move(fixes_);
  }

 private:
  void begin_day(const Fields& fields, std::optional<double> day) {
    if (!day || !time_of_day_s(fields, 1)) return;
    if (!first_day_s_) first_day_s_ = day, undated_ = fixes_.size();
    day_s_ = *day;
  }

  void add_fix(const Fields& fields) {
    const auto time_s = time_of_day_s(fields, 1), latitude = degrees(fields, 2, 'S', 90.0),
               longitude = degrees(fields, 4, 'W', 180.0), quality = number(fields, 6), dilution = number(fields, 8),
               above_sea_m = number(fields, 9), geoid_m = number(fields, 11);
    if (!time_s || !latitude || !longitude || !quality || *quality < 1.0 || !above_sea_m) return;
    // A date comes with every cycle, perhaps after the first fix of a new day.
    if (*time_s + 43200.0 < last_time_s_ && first_day_s_) day_s_ += 86400.0;
    last_time_s_ = *time_s;
    const double error_m = Receiver::error_m(static_cast<int>(*quality)) * std::max(1.0, dilution.value_or(1.0));
    fixes_.push_back({day_s_ + *time_s,
                      *latitude,
                      *longitude,
                      *above_sea_m + geoid_m.value_or(0.0),
                      {error_m, error_m, Receiver::kUpward * error_m}});
  }

  std::vector<GpsFix> fixes_;
  std::optional<double> first_day_s_;
  std::size_t undated_ = 0;
  double day_s_ = 0.0, last_time_s_ = -1.0;
};

}  // namespace

Result<std::vector<GpsFix>> read_nmea(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return Error{file.string() + ": cannot be read"};
  Log log;
  std::size_t lines = 0, damaged = 0;
  for (std::string line; std::getline(stream, line); ++lines) {
    const auto payload = payload_of(line);
    payload ? log.add(*payload) : void(++damaged);
  }
  auto fixes = log.take();
  if (!fixes.empty()) return fixes;
  return Error{file.string() + ": holds no fix (GGA sentences of NMEA 0183 are read); " + std::to_string(lines) +
               " lines, " + std::to_string(damaged) + " of them damaged or no sentence"};
}

}  // namespace revisit

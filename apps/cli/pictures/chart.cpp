// SPDX-License-Identifier: Apache-2.0
#include "pictures/chart.hpp"

#include <cmath>

#include <revisit/core/text.hpp>

namespace revisit::cli {
namespace {

// Steps of 1, 2 or 5 times a power of ten, about six to an axis.
double tick_step(double span) {
  const double raw = span / 6.0, power = std::pow(10.0, std::floor(std::log10(raw))), lead = raw / power;
  return power * (lead < 1.5 ? 1.0 : lead < 3.5 ? 2.0 : lead < 7.5 ? 5.0 : 10.0);
}

std::vector<double> ticks(const Chart::Range& range, double step) {
  std::vector<double> values;
  const auto last = static_cast<long>(std::floor(range.max / step + 1e-9));
  for (auto i = static_cast<long>(std::ceil(range.min / step - 1e-9)); i <= last; ++i)
    values.push_back(static_cast<double>(i) * step);
  return values;
}

std::string number(double value, double step) {
  return format("%.*f", step >= 1.0 ? 0 : static_cast<int>(std::ceil(-std::log10(step))),
                std::abs(value) < 1e-9 * step ? 0.0 : value);
}

void widen(Chart::Range& range, double span) {
  const double centre = (range.min + range.max) / 2.0;
  range = {centre - span / 2.0, centre + span / 2.0};
}

}  // namespace

Chart::Chart(Canvas& canvas, const Box& box, Range x, Range y, bool equal_scale)
    : canvas_(canvas), box_(box), x_(x), y_(y) {
  for (Range* each : {&x_, &y_})
    if (!(each->max - each->min > 1e-9)) widen(*each, 1.0);
  if (!equal_scale) return;
  const double per_pixel = std::max((x_.max - x_.min) / box.width, (y_.max - y_.min) / box.height);
  widen(x_, per_pixel * box.width);
  widen(y_, per_pixel * box.height);
}

Pixel Chart::at(double x, double y) const {
  return {box_.x + (x - x_.min) / (x_.max - x_.min) * box_.width,
          box_.y + box_.height - (y - y_.min) / (y_.max - y_.min) * box_.height};
}

void Chart::draw_axes(const std::string& title, const std::string& x_label, const std::string& y_label) {
  constexpr Colour kGrid{0.88, 0.88, 0.88}, kFrame{0.3, 0.3, 0.3};
  const double x_step = tick_step(x_.max - x_.min), y_step = tick_step(y_.max - y_.min);
  const double bottom = box_.y + box_.height;
  for (const double x : ticks(x_, x_step)) {
    const Pixel p = at(x, y_.min);
    canvas_.line({{p.x, box_.y}, {p.x, bottom}}, kGrid, 1.0);
    canvas_.text({p.x, bottom + 16}, number(x, x_step), 14, Align::kCentre);
  }
  for (const double y : ticks(y_, y_step)) {
    const Pixel p = at(x_.min, y);
    canvas_.line({{box_.x, p.y}, {box_.x + box_.width, p.y}}, kGrid, 1.0);
    canvas_.text({box_.x - 8, p.y}, number(y, y_step), 14, Align::kRight);
  }
  canvas_.frame(box_, kFrame);
  canvas_.text({box_.x + box_.width / 2, box_.y - 20}, title, 18, Align::kCentre);
  canvas_.text({box_.x + box_.width / 2, bottom + 42}, x_label, 15, Align::kCentre);
  canvas_.text_upwards({box_.x - 58, box_.y + box_.height / 2}, y_label, 15);
}

}  // namespace revisit::cli

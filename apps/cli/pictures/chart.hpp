// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "pictures/canvas.hpp"

namespace revisit::cli {

/// A frame with ticks and labels on a canvas, and the map from data to pixels.
class Chart {
 public:
  struct Range {
    double min = 0.0, max = 1.0;
  };
  /// With `equal_scale`, the shorter range grows so that a metre is as long on both axes.
  Chart(Canvas& canvas, const Box& box, Range x, Range y, bool equal_scale = false);

  void draw_axes(const std::string& title, const std::string& x_label, const std::string& y_label);
  Pixel at(double x, double y) const;
  double pixels_per_x() const { return box_.width / (x_.max - x_.min); }
  const Box& box() const { return box_; }

 private:
  Canvas& canvas_;
  Box box_;
  Range x_, y_;
};

}  // namespace revisit::cli

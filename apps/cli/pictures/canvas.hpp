// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <revisit/core/result.hpp>

namespace revisit::cli {

struct Colour {
  double r = 0.0, g = 0.0, b = 0.0, a = 1.0;
};
/// Dark blue over green to yellow for t in [0, 1]: equal steps look equal, also without colour vision.
Colour scale_colour(double t);

struct Pixel {
  double x = 0.0, y = 0.0;
};
struct Box {
  double x = 0.0, y = 0.0, width = 0.0, height = 0.0;
};
enum class Align { kLeft, kCentre, kRight };

/// A white picture to draw on, origin at the top left, in pixels; Cairo stays inside.
class Canvas {
 public:
  Canvas(int width, int height);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  void fill(const Box& box, const Colour& colour);
  void frame(const Box& box, const Colour& colour);
  void line(const std::vector<Pixel>& points, const Colour& colour, double width = 1.5, bool is_dashed = false);
  void dot(Pixel at, double radius, const Colour& colour);
  void ring(Pixel centre, double radius, const Colour& colour);
  /// `at` is the middle of the text's height at the side that `align` names.
  void text(Pixel at, const std::string& text, double size, Align align = Align::kLeft, const Colour& colour = {});
  void text_upwards(Pixel at, const std::string& text, double size);
  /// Drawing is confined to `box` until unclip.
  void clip(const Box& box);
  void unclip();
  Status save_png(const std::filesystem::path& file);

 private:
  struct Cairo;
  std::unique_ptr<Cairo> cairo_;
};

}  // namespace revisit::cli

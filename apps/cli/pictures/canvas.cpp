// SPDX-License-Identifier: Apache-2.0
#include "pictures/canvas.hpp"

#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace revisit::cli {

Colour scale_colour(double t) {
  static constexpr std::array<Colour, 5> kStops = {{{0.267, 0.005, 0.329},
                                                    {0.230, 0.322, 0.546},
                                                    {0.128, 0.567, 0.551},
                                                    {0.369, 0.789, 0.383},
                                                    {0.993, 0.906, 0.144}}};
  const double at = std::clamp(t, 0.0, 1.0) * (kStops.size() - 1);
  const auto i = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double f = at - static_cast<double>(i);
  const Colour &a = kStops[i], &b = kStops[i + 1];
  return {a.r + f * (b.r - a.r), a.g + f * (b.g - a.g), a.b + f * (b.b - a.b)};
}

struct Canvas::Cairo {
  Cairo(int width, int height)
      : surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height)), context(cairo_create(surface)) {}
  ~Cairo() {
    cairo_destroy(context);
    cairo_surface_destroy(surface);
  }
  Cairo(const Cairo&) = delete;
  Cairo& operator=(const Cairo&) = delete;

  cairo_surface_t* surface;
  cairo_t* context;
};

Canvas::Canvas(int width, int height) : cairo_(std::make_unique<Cairo>(width, height)) {
  fill({0.0, 0.0, static_cast<double>(width), static_cast<double>(height)}, {1.0, 1.0, 1.0});
  cairo_select_font_face(cairo_->context, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_line_join(cairo_->context, CAIRO_LINE_JOIN_ROUND);
}

Canvas::~Canvas() = default;

void Canvas::fill(const Box& box, const Colour& c) {
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_rectangle(cairo_->context, box.x, box.y, box.width, box.height);
  cairo_fill(cairo_->context);
}

void Canvas::frame(const Box& box, const Colour& c) {
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_set_line_width(cairo_->context, 1.0);
  cairo_rectangle(cairo_->context, box.x, box.y, box.width, box.height);
  cairo_stroke(cairo_->context);
}

void Canvas::line(const std::vector<Pixel>& points, const Colour& c, double width, bool is_dashed) {
  if (points.empty()) return;
  constexpr double kDash[] = {8.0, 4.0};
  cairo_set_dash(cairo_->context, kDash, is_dashed ? 2 : 0, 0.0);
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_set_line_width(cairo_->context, width);
  cairo_move_to(cairo_->context, points.front().x, points.front().y);
  for (const Pixel& p : points) cairo_line_to(cairo_->context, p.x, p.y);
  cairo_stroke(cairo_->context);
  cairo_set_dash(cairo_->context, nullptr, 0, 0.0);
}

void Canvas::dot(Pixel at, double radius, const Colour& c) {
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_new_sub_path(cairo_->context);
  cairo_arc(cairo_->context, at.x, at.y, radius, 0.0, 2.0 * M_PI);
  cairo_fill(cairo_->context);
}

void Canvas::ring(Pixel centre, double radius, const Colour& c) {
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_set_line_width(cairo_->context, 1.0);
  cairo_new_sub_path(cairo_->context);
  cairo_arc(cairo_->context, centre.x, centre.y, radius, 0.0, 2.0 * M_PI);
  cairo_stroke(cairo_->context);
}

void Canvas::text(Pixel at, const std::string& text, double size, Align align, const Colour& c) {
  cairo_set_source_rgba(cairo_->context, c.r, c.g, c.b, c.a);
  cairo_set_font_size(cairo_->context, size);
  cairo_text_extents_t extents;
  cairo_text_extents(cairo_->context, text.c_str(), &extents);
  const double share = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  cairo_move_to(cairo_->context, at.x - share * extents.x_advance, at.y + 0.36 * size);
  cairo_show_text(cairo_->context, text.c_str());
}

void Canvas::text_upwards(Pixel at, const std::string& words, double size) {
  cairo_save(cairo_->context);
  cairo_translate(cairo_->context, at.x, at.y);
  cairo_rotate(cairo_->context, -M_PI / 2.0);
  text({0.0, 0.0}, words, size, Align::kCentre);
  cairo_restore(cairo_->context);
}

void Canvas::clip(const Box& box) {
  cairo_save(cairo_->context);
  cairo_rectangle(cairo_->context, box.x, box.y, box.width, box.height);
  cairo_clip(cairo_->context);
}

void Canvas::unclip() { cairo_restore(cairo_->context); }

Status Canvas::save_png(const std::filesystem::path& file) {
  const cairo_status_t status = cairo_surface_write_to_png(cairo_->surface, file.c_str());
  if (status != CAIRO_STATUS_SUCCESS)
    return Error{file.string() + ": cannot be written: " + cairo_status_to_string(status)};
  return ok();
}

}  // namespace revisit::cli

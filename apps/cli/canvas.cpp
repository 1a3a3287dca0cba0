// SPDX-License-Identifier: Apache-2.0
#include "canvas.hpp"

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

Canvas::Canvas(int width, int height)
    : surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height)), context_(cairo_create(surface_)) {
  fill({0.0, 0.0, static_cast<double>(width), static_cast<double>(height)}, {1.0, 1.0, 1.0});
  cairo_select_font_face(context_, "DejaVu Sans", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_line_join(context_, CAIRO_LINE_JOIN_ROUND);
}

Canvas::~Canvas() {
  cairo_destroy(context_);
  cairo_surface_destroy(surface_);
}

void Canvas::fill(const Box& box, const Colour& c) {
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_rectangle(context_, box.x, box.y, box.width, box.height);
  cairo_fill(context_);
}

void Canvas::frame(const Box& box, const Colour& c) {
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_set_line_width(context_, 1.0);
  cairo_rectangle(context_, box.x, box.y, box.width, box.height);
  cairo_stroke(context_);
}

void Canvas::line(const std::vector<Pixel>& points, const Colour& c, double width) {
  if (points.empty()) return;
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_set_line_width(context_, width);
  cairo_move_to(context_, points.front().x, points.front().y);
  for (const Pixel& p : points) cairo_line_to(context_, p.x, p.y);
  cairo_stroke(context_);
}

void Canvas::dot(Pixel at, double radius, const Colour& c) {
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_new_sub_path(context_);
  cairo_arc(context_, at.x, at.y, radius, 0.0, 2.0 * M_PI);
  cairo_fill(context_);
}

void Canvas::ring(Pixel centre, double radius, const Colour& c) {
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_set_line_width(context_, 1.0);
  cairo_new_sub_path(context_);
  cairo_arc(context_, centre.x, centre.y, radius, 0.0, 2.0 * M_PI);
  cairo_stroke(context_);
}

void Canvas::text(Pixel at, const std::string& text, double size, Align align, const Colour& c) {
  cairo_set_source_rgba(context_, c.r, c.g, c.b, c.a);
  cairo_set_font_size(context_, size);
  cairo_text_extents_t extents;
  cairo_text_extents(context_, text.c_str(), &extents);
  const double share = align == Align::kLeft ? 0.0 : align == Align::kCentre ? 0.5 : 1.0;
  cairo_move_to(context_, at.x - share * extents.x_advance, at.y + 0.36 * size);
  cairo_show_text(context_, text.c_str());
}

void Canvas::text_upwards(Pixel at, const std::string& words, double size) {
  cairo_save(context_);
  cairo_translate(context_, at.x, at.y);
  cairo_rotate(context_, -M_PI / 2.0);
  text({0.0, 0.0}, words, size, Align::kCentre);
  cairo_restore(context_);
}

void Canvas::clip(const Box& box) {
  cairo_save(context_);
  cairo_rectangle(context_, box.x, box.y, box.width, box.height);
  cairo_clip(context_);
}

void Canvas::unclip() { cairo_restore(context_); }

Status Canvas::save_png(const std::filesystem::path& file) {
  const cairo_status_t status = cairo_surface_write_to_png(surface_, file.c_str());
  if (status != CAIRO_STATUS_SUCCESS)
    return Error{file.string() + ": cannot be written: " + cairo_status_to_string(status)};
  return ok();
}

}  // namespace revisit::cli

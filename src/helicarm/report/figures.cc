// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/figures.h"

#include <algorithm>
#include <iterator>
#include <optional>

#include <fmt/format.h>

#include "helicarm/image/png.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/picture.h"

namespace helicarm {
namespace {

using Pixel = Eigen::Vector2d;

/// Collects SVG elements; `unit` is about a thousandth of the picture's width, so that strokes look alike at
/// any size.
class Drawing {
 public:
  explicit Drawing(double unit) : unit_(unit) {}

  double unit() const { return unit_; }
  void circle(std::string_view kind, const Pixel& at, double radius) {
    put(R"(<circle class="{}" cx="{:.2f}" cy="{:.2f}" r="{:.2f}"/>)", kind, at.x(), at.y(), radius * unit_);
  }
  void line(std::string_view kind, const Pixel& a, const Pixel& b) {
    put(R"(<line class="{}" x1="{:.2f}" y1="{:.2f}" x2="{:.2f}" y2="{:.2f}"/>)", kind, a.x(), a.y(), b.x(),
        b.y());
  }
  void arrow(std::string_view kind, const Pixel& from, const Pixel& to) {
    line(kind, from, to);
    const Pixel along = to - from;
    if (along.norm() < 4 * unit_) return;
    const Pixel back = -5 * unit_ * along.normalized();
    const Pixel side{-back.y() * 0.5, back.x() * 0.5};
    line(kind, to, to + back + side);
    line(kind, to, to + back - side);
  }
  void cross(std::string_view kind, const Pixel& at, double arm) {
    const Pixel a{arm * unit_, arm * unit_};
    const Pixel b{arm * unit_, -arm * unit_};
    line(kind, at - a, at + a);
    line(kind, at - b, at + b);
  }
  void text(std::string_view kind, const Pixel& at, std::string_view words) {
    put(R"(<text class="{}" x="{:.2f}" y="{:.2f}" font-size="{:.1f}">{}</text>)", kind, at.x(), at.y(),
        15 * unit_, escaped(words));
  }
  template <class... Args>
  void put(fmt::format_string<Args...> format, Args&&... args) {
    fmt::format_to(std::back_inserter(elements_), format, std::forward<Args>(args)...);
    elements_ += '\n';
  }
  std::string svg(std::string_view title, int width, int height) const {
    return fmt::format(R"(<svg viewBox="-0.5 -0.5 {} {}" role="img" aria-label="{}" stroke-width="{:.2f}">)"
                       "\n{}</svg>\n",
                       width, height, escaped(title), 1.5 * unit_, elements_);
  }

 private:
  double unit_;
  std::string elements_;
};

double unit_of(const ViewResult& view) { return view.exposure->pixels.width() / 1024.0; }

/// A bar in the lower left corner that says how long `length` is once magnified.
void scale_bar(Drawing& drawing, int height, double length, double magnification, std::string_view what) {
  const Pixel left{24 * drawing.unit(), height - 24 * drawing.unit()};
  drawing.line("bar", left, left + Pixel(length * magnification, 0));
  drawing.text("bar-text", left - Pixel(0, 10 * drawing.unit()),
               fmt::format("{} {:g} px, magnified {:g} times", what, length, magnification));
}

std::optional<Pixel> rectified(const ViewResult& view, const Pixel& raw) {
  return view.rectification->map.rectified_from_raw(raw);
}

void draw_dots(Drawing& drawing, const ViewResult& view) {
  for (const Dot& dot : view.rectification->plate_dots)
    if (const auto at = rectified(view, dot.centre_px))
      drawing.circle("plate", *at, dot.radius_px / drawing.unit());
  if (view.found)
    for (const Dot& blob : view.found->false_blobs)
      if (const auto at = rectified(view, blob.centre_px)) drawing.cross("false", *at, 8);
}

void draw_fiducials(Drawing& drawing, const ViewResult& view, int height) {
  const auto& calibrated = view.calibrated;
  double largest = 0;
  for (const Fiducial& fiducial : view.found->fiducials)
    if (fiducial.status == FiducialStatus::used) largest = std::max(largest, fiducial.residual_px);
  const double magnification = largest > 0 ? round_below(60 * drawing.unit() / largest) : 1;
  for (const Fiducial& fiducial : view.found->fiducials) {
    const bool used = fiducial.status == FiducialStatus::used;
    if (!used && fiducial.status != FiducialStatus::rejected) continue;
    drawing.circle(used ? "ball" : "ball lost", fiducial.uv, 15);
    drawing.text("label", fiducial.uv + drawing.unit() * Pixel(18, -10), fiducial.label);
    if (used && calibrated) {
      const Pixel residual = fiducial.uv - calibrated->view.project(fiducial.centre_in_calibrator);
      drawing.arrow("residual", fiducial.uv, fiducial.uv + magnification * residual);
    }
  }
  if (calibrated && largest > 0)
    scale_bar(drawing, height, round_below(largest), magnification, "residuals:");
}

void draw_points(Drawing& drawing, const Result& result, std::size_t view) {
  for (const PointResult& point : result.points)
    if (const auto& seen = point.seen[view]) {
      drawing.cross("point", seen->uv, 7);
      drawing.text("label point-text", seen->uv + drawing.unit() * Pixel(11, 16), point.name);
    }
}

void draw_lines(Drawing& drawing, const Result& result, std::size_t view) {
  const View& projection = result.views[view].calibrated->view;
  for (const auto& [start, end] : result.tunnel_ends)
    if (result.points[start].seen[view] && result.points[end].seen[view])
      drawing.line("planned", result.points[start].seen[view]->uv, result.points[end].seen[view]->uv);
  for (const ToolLine& tool : result.tool_lines) {
    if (projection.depth(tool.p1_in_calibrator) < 1 || projection.depth(tool.p2_in_calibrator) < 1) continue;
    const Pixel a = projection.project(tool.p1_in_calibrator);
    const Pixel b = projection.project(tool.p2_in_calibrator);
    drawing.line("tool", a - 3 * (b - a), b + 3 * (b - a));
  }
}

}  // namespace

std::string view_figure(const Result& result, std::size_t index) {
  const ViewResult& view = result.views[index];
  if (!view.exposure) return {};
  const Image<std::uint8_t> picture = rectified_picture(view);
  Drawing drawing(unit_of(view));
  drawing.put(R"(<image x="-0.5" y="-0.5" width="{}" height="{}" href="data:image/png;base64,{}"/>)",
              picture.width(), picture.height(), base64(encode_png(picture)));
  if (view.rectification) draw_dots(drawing, view);
  if (view.found) draw_fiducials(drawing, view, picture.height());
  draw_points(drawing, result, index);
  if (view.calibrated) draw_lines(drawing, result, index);
  return drawing.svg("X-ray " + view.name, picture.width(), picture.height());
}

std::string distortion_figure(const ViewResult& view) {
  if (!view.rectification || view.rectification->map.is_identity()) return {};
  const DistortionMap& map = view.rectification->map;
  const Pixel size = map.hull_high - map.hull_low;
  if (!(size.minCoeff() > 0)) return {};
  constexpr int cells = 16;
  const Pixel cell = size / cells;
  std::vector<std::pair<Pixel, Pixel>> field;
  double largest = 0;
  for (int i = 0; i <= cells; ++i)
    for (int j = 0; j <= cells; ++j) {
      const Pixel at = map.hull_low + cell.cwiseProduct(Pixel(i, j));
      field.emplace_back(at, map.raw_from_rectified(at) - at);
      largest = std::max(largest, field.back().second.norm());
    }
  if (!(largest > 0)) return {};
  Drawing drawing(map.width / 1024.0);
  const double magnification = std::max(round_below(1.2 * cell.minCoeff() / largest), 1.0);
  drawing.put(R"(<rect class="frame" x="-0.5" y="-0.5" width="{}" height="{}"/>)", map.width, map.height);
  for (const auto& [at, displacement] : field) drawing.arrow("field", at, at + magnification * displacement);
  scale_bar(drawing, map.height, round_below(largest), magnification, "distortion:");
  return drawing.svg("Distortion of " + view.name, map.width, map.height);
}

}  // namespace helicarm

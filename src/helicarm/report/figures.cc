// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/figures.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/image/png.h"
#include "helicarm/report/marks.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/rectified_image.h"

namespace helicarm::report {
namespace {

using Pixel = Eigen::Vector2d;

/// Collects SVG elements; `unit` is about a thousandth of the image's width, for equal strokes at any size.
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

double unit_of(const pipeline::ViewResult& view) { return view.xray_image->pixels.width() / 1024.0; }

/// Scale bar in the lower left corner: the true length that the magnified bar shows.
void scale_bar(Drawing& drawing, int height, double length, double magnification, std::string_view what) {
  const Pixel left{24 * drawing.unit(), height - 24 * drawing.unit()};
  drawing.line("bar", left, left + Pixel(length * magnification, 0));
  drawing.text("bar-text", left - Pixel(0, 10 * drawing.unit()),
               fmt::format("{} {:g} px, magnified {:g} times", what, length, magnification));
}

void draw_dots(Drawing& drawing, const ViewMarks& marks) {
  for (const DotMark& dot : marks.plate_dots)
    drawing.circle("plate", dot.place, dot.radius_px / drawing.unit());
  for (const DotMark& blob : marks.false_blobs) drawing.cross("false", blob.place, 8);
  for (const DotMark& candidate : marks.candidates) drawing.circle("candidate", candidate.place, 15);
  for (const BallMark& guess : marks.guessed)
    drawing.text("label guess", guess.place + drawing.unit() * Pixel(18, -10), guess.label);
}

void draw_balls(Drawing& drawing, const ViewMarks& marks, int height) {
  const double largest = largest_residual(marks);
  const double magnification = largest > 0 ? round_below(60 * drawing.unit() / largest) : 1;
  for (const BallMark& ball : marks.balls) {
    drawing.circle(ball.used ? "ball" : "ball lost", ball.place, 15);
    drawing.text("label", ball.place + drawing.unit() * Pixel(18, -10), ball.label);
    if (ball.used && ball.residual)
      drawing.arrow("residual", ball.place, ball.place + magnification * *ball.residual);
  }
  if (largest > 0) scale_bar(drawing, height, round_below(largest), magnification, "residuals:");
}

void draw_points(Drawing& drawing, const ViewMarks& marks) {
  for (const PointMark& point : marks.points) {
    drawing.cross("point", point.place, 7);
    drawing.text("label point-text", point.place + drawing.unit() * Pixel(11, 16), point.name);
  }
}

void draw_lines(Drawing& drawing, const ViewMarks& marks) {
  for (const rectification::PixelPath& tunnel : marks.tunnels)
    drawing.line("planned", tunnel.front(), tunnel.back());
  for (const rectification::PixelPath& tool : marks.tool_lines)
    drawing.line("tool", tool.front(), tool.back());
}

}  // namespace

std::string view_figure(const pipeline::Result& result, std::size_t index) {
  const pipeline::ViewResult& view = result.views[index];
  if (!view.xray_image) return {};
  const image::Image<std::uint8_t> view_image = rectified_image(view);
  Drawing drawing(unit_of(view));
  constexpr int most_shown_px = 2048;  // larger ones would make a report of tens of megabytes
  drawing.put(
      R"(<image x="-0.5" y="-0.5" width="{}" height="{}" preserveAspectRatio="none" href="data:image/png;base64,{}"/>)",
      view_image.width(), view_image.height(), base64(image::encode_png(at_most(view_image, most_shown_px))));
  const ViewMarks marks = marks_of(result, index);
  draw_dots(drawing, marks);
  draw_balls(drawing, marks, view_image.height());
  draw_points(drawing, marks);
  draw_lines(drawing, marks);
  return drawing.svg("X-ray " + view.name, view_image.width(), view_image.height());
}

std::string distortion_figure(const pipeline::ViewResult& view) {
  if (!view.rectification || view.rectification->map.is_identity()) return {};
  const rectification::DistortionMap& map = view.rectification->map;
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

}  // namespace helicarm::report

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/drawing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

namespace helicarm::phantom {
namespace {

constexpr const char* ink = "#1d2733";
constexpr const char* steel = "#5b6b7f";
constexpr const char* measure = "#2563a8";
constexpr const char* target_ink = "#b4472e";

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&')
      safe += "&amp;";
    else if (c == '<')
      safe += "&lt;";
    else if (c == '>')
      safe += "&gt;";
    else if (static_cast<unsigned char>(c) >= 0x20)
      safe += c;
  }
  return safe;
}

/// A sheet in mm, y down.
class Sheet {
 public:
  Sheet(double width, double height) : width_(width), height_(height) {}

  void circle(const Eigen::Vector2d& c, double radius, const char* colour) {
    body_ += fmt::format("<circle cx=\"{:.3f}\" cy=\"{:.3f}\" r=\"{:.3f}\" fill=\"{}\"/>\n", c.x(), c.y(),
                         radius, colour);
  }
  void frame(const Eigen::Vector2d& corner, const Eigen::Vector2d& size) {
    body_ += fmt::format(
        "<rect x=\"{:.3f}\" y=\"{:.3f}\" width=\"{:.3f}\" height=\"{:.3f}\" rx=\"4\" fill=\"#f3f6fa\" "
        "stroke=\"{}\" stroke-width=\"0.35\"/>\n",
        corner.x(), corner.y(), size.x(), size.y(), ink);
  }
  void line(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const char* colour, const char* extra = "") {
    body_ += fmt::format(
        "<line x1=\"{:.3f}\" y1=\"{:.3f}\" x2=\"{:.3f}\" y2=\"{:.3f}\" stroke=\"{}\" "
        "stroke-width=\"0.25\" {}/>\n",
        a.x(), a.y(), b.x(), b.y(), colour, extra);
  }
  void text(const Eigen::Vector2d& at, const std::string& words, const char* colour,
            const char* anchor = "start", double size = 3.5, double turn_deg = 0) {
    body_ += fmt::format(
        "<text transform=\"translate({:.3f} {:.3f}) rotate({})\" font-size=\"{}\" fill=\"{}\" "
        "text-anchor=\"{}\" paint-order=\"stroke\" stroke=\"white\" stroke-width=\"0.6\">{}</text>\n",
        at.x(), at.y(), turn_deg, size, colour, anchor, escaped(words));
  }
  /// Dimension line from a to b with its length, moved by `offset`, with extension lines.
  void dimension(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& offset) {
    const bool upright = std::abs(b.x() - a.x()) < std::abs(b.y() - a.y());
    line(a, a + offset * 1.15, measure, "opacity=\"0.6\"");
    line(b, b + offset * 1.15, measure, "opacity=\"0.6\"");
    line(a + offset, b + offset, measure, "marker-start=\"url(#arrow)\" marker-end=\"url(#arrow)\"");
    const Eigen::Vector2d above = upright ? Eigen::Vector2d(-1.2, 0) : Eigen::Vector2d(0, -1.2);
    text((a + b) / 2 + offset + above, fmt::format("{:.6g}", std::round((b - a).norm() * 100) / 100), measure,
         "middle", 3.5, upright ? -90 : 0);
  }
  std::string finish() const {
    return fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.3f}mm\" height=\"{1:.3f}mm\" viewBox=\"0 0 "
        "{0:.3f} "
        "{1:.3f}\" font-family=\"Helvetica, Arial, sans-serif\">\n<defs><marker id=\"arrow\" viewBox=\"0 0 "
        "10 6\" "
        "refX=\"10\" refY=\"3\" markerWidth=\"10\" markerHeight=\"6\" orient=\"auto-start-reverse\"><path "
        "d=\"M0 0 L10 "
        "3 L0 6 z\" fill=\"{2}\"/></marker></defs>\n<rect width=\"100%\" height=\"100%\" "
        "fill=\"white\"/>\n{3}</svg>\n",
        width_, height_, measure, body_);
  }

 private:
  double width_;
  double height_;
  std::string body_;
};

/// One view of the calibrator: `flat` maps mm of the calibrator to mm on the sheet (right, down).
void draw_view(Sheet& sheet, const Calibrator& calibrator, const Eigen::Matrix<double, 2, 3>& flat,
               const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Eigen::Vector2d& corner,
               const std::string& title, const char* right, const char* up) {
  const auto place = [&](const Eigen::Vector3d& p) -> Eigen::Vector2d { return corner + flat * p - low; };
  const Eigen::Vector2d origin = place(Eigen::Vector3d::Zero());
  sheet.text(corner + Eigen::Vector2d(0, -16), title, ink, "start", 4.5);
  sheet.line(origin, origin + Eigen::Vector2d(12, 0), ink, "marker-end=\"url(#arrow)\"");
  sheet.line(origin, origin + Eigen::Vector2d(0, -12), ink, "marker-end=\"url(#arrow)\"");
  sheet.text(origin + Eigen::Vector2d(13, 1), right, ink);
  sheet.text(origin + Eigen::Vector2d(-1, -13), up, ink);
  for (const auto& ball : calibrator.balls)
    sheet.circle(place(ball.centre_in_calibrator), ball.diameter_mm / 2, steel);
  for (const auto& ball : calibrator.balls)
    sheet.text(place(ball.centre_in_calibrator) + ball.diameter_mm * Eigen::Vector2d(0.65, -0.25), ball.label,
               ink, "start", 3);
  for (const auto& target : calibrator.targets) {
    const Eigen::Vector2d at = place(target.point_in_calibrator);
    sheet.line(at - Eigen::Vector2d(1.5, 1.5), at + Eigen::Vector2d(1.5, 1.5), target_ink);
    sheet.line(at - Eigen::Vector2d(1.5, -1.5), at + Eigen::Vector2d(1.5, -1.5), target_ink);
    sheet.text(at + Eigen::Vector2d(2.2, 3.4), target.name, target_ink, "start", 3);
  }
  const Eigen::Vector2d size = high - low;
  sheet.dimension(corner + Eigen::Vector2d(0, size.y()), corner + size, {0, 10});
  sheet.dimension(corner + Eigen::Vector2d(0, size.y()), corner, {-10, 0});
}

constexpr double table_row = 4.5, table_width = 82;

/// A row for each ball and target: name, coordinates and diameter in mm.
void draw_table(Sheet& sheet, const Calibrator& calibrator, Eigen::Vector2d at) {
  const auto row = [&](const std::string& name, const std::array<std::string, 4>& cells, const char* colour) {
    sheet.text(at, name, colour, "start", 3);
    for (std::size_t i = 0; i < cells.size(); ++i)
      sheet.text(at + Eigen::Vector2d(34 + 16 * double(i), 0), cells[i], colour, "end", 3);
    at.y() += table_row;
  };
  const auto entry = [&](const std::string& name, const Eigen::Vector3d& p, double diameter,
                         const char* colour) {
    row(name,
        {fmt::format("{:.3f}", p.x()), fmt::format("{:.3f}", p.y()), fmt::format("{:.3f}", p.z()),
         fmt::format("{:.3f}", diameter)},
        colour);
  };
  row("", {"x", "y", "z", "diameter"}, measure);
  for (const auto& ball : calibrator.balls)
    entry(ball.label, ball.centre_in_calibrator, ball.diameter_mm, ink);
  for (const auto& target : calibrator.targets)
    entry(target.name, target.point_in_calibrator, target.diameter_mm, target_ink);
}

}  // namespace

Expected<std::string> drawing_of(const Plate& plate) {
  if (plate.dots_mm.empty())
    return fail(Reason::bad_value, fmt::format("{}: an unbounded lattice cannot be drawn", plate.name));
  Eigen::AlignedBox2d box;
  for (const auto& dot : plate.dots_mm) box.extend(dot);
  const double border = plate.pitch_mm.value_or(4 * plate.diameter_mm) / 2;
  const Eigen::Vector2d margin(25, 30);
  Sheet sheet(box.sizes().x() + 2 * (border + margin.x()), box.sizes().y() + 2 * (border + margin.y()));
  const auto place = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return p - box.min() + margin + Eigen::Vector2d::Constant(border);
  };
  sheet.frame(margin, box.sizes() + Eigen::Vector2d::Constant(2 * border));
  const Eigen::Vector2d origin = place(Eigen::Vector2d::Zero());
  for (const Eigen::Vector2d& axis : {Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1)}) {
    sheet.line(origin, origin + 8 * axis, ink, "marker-end=\"url(#arrow)\"");
    sheet.text(origin + 9 * axis + Eigen::Vector2d(0.5, axis.y() > 0 ? 2.5 : 1), axis.y() > 0 ? "y" : "x",
               ink);
  }
  for (const auto& dot : plate.dots_mm) sheet.circle(place(dot), plate.diameter_mm / 2, steel);
  const Eigen::Vector2d low = place(box.min());
  const Eigen::Vector2d high = place(box.max());
  if (box.sizes().x() > 0) sheet.dimension({low.x(), high.y()}, high, {0, border + 8});
  if (box.sizes().y() > 0) sheet.dimension({low.x(), high.y()}, low, {-border - 8, 0});
  const auto number = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.6g} mm", *value) : std::string("not given");
  };
  sheet.text({margin.x(), 10}, plate.name, ink, "start", 6);
  sheet.text({margin.x(), 17},
             fmt::format("{} {} of {:.6g} mm on a {} lattice, pitch {}, {} above the receiver",
                         plate.dots_mm.size(), plate.kind == DotKind::balls ? "balls" : "holes",
                         plate.diameter_mm, plate.lattice == Lattice::square ? "square" : "hexagonal",
                         number(plate.pitch_mm), number(plate.height_above_receiver_mm)),
             ink, "start", 3.2);
  sheet.text({margin.x(), 23}, "1 : 1, mm, seen from the source", ink, "start", 3.2);
  return sheet.finish();
}

std::string drawing_of(const Calibrator& calibrator) {
  const Eigen::Matrix<double, 2, 3> from_above =
      (Eigen::Matrix<double, 2, 3>() << 1, 0, 0, 0, -1, 0).finished();
  const Eigen::Matrix<double, 2, 3> from_side =
      (Eigen::Matrix<double, 2, 3>() << 1, 0, 0, 0, 0, -1).finished();
  Eigen::AlignedBox2d above(Eigen::Vector2d::Zero());
  Eigen::AlignedBox2d side(Eigen::Vector2d::Zero());
  const auto extend = [&](const Eigen::Vector3d& point) {
    above.extend(from_above * point);
    side.extend(from_side * point);
  };
  for (const auto& ball : calibrator.balls) extend(ball.centre_in_calibrator);
  for (const auto& target : calibrator.targets) extend(target.point_in_calibrator);
  const double left = 30, top = 46, between = 45;
  const double views = above.sizes().x() + side.sizes().x() + 2 * left + between;
  const double rows = table_row * double(2 + calibrator.balls.size() + calibrator.targets.size());
  Sheet sheet(views + table_width, std::max({above.sizes().y() + 25, side.sizes().y() + 25, rows}) + top);
  sheet.text({left - 10, 12}, calibrator.name, ink, "start", 6);
  sheet.text({left - 10, 19}, "1 : 1, mm; the extents are those of the centres and the origin", ink, "start",
             3.2);
  draw_view(sheet, calibrator, from_above, above.min(), above.max(), {left, top}, "from above", "x", "y");
  draw_view(sheet, calibrator, from_side, side.min(), side.max(), {left + above.sizes().x() + between, top},
            "from the side", "x", "z");
  draw_table(sheet, calibrator, {views, top});
  return sheet.finish();
}

}  // namespace helicarm::phantom

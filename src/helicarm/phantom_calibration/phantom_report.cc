// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/phantom_report.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/image/png.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/table.h"

namespace helicarm::phantom_calibration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double usual_tolerance_mm = 0.3;  // of a printed and glued phantom, per axis
constexpr double off_by = 3;                // tolerances

std::vector<Vector3d> centres_of(const PhantomResult& result) {
  std::vector<Vector3d> centres;
  for (const MeasuredBall& ball : result.balls) centres.push_back(ball.centre);
  return centres;
}

Vector3d mean_of(const std::vector<Vector3d>& points) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& point : points) sum += point;
  return sum / double(std::max<std::size_t>(1, points.size()));
}

double tolerance_of(const PhantomResult& result) {
  return result.nominal && result.nominal->tolerance_mm > 0 ? result.nominal->tolerance_mm
                                                            : usual_tolerance_mm;
}

double nominal_rms(const PhantomResult& result) {
  double sum = 0;
  for (const MeasuredBall& ball : result.balls) sum += ball.from_nominal->squaredNorm();
  return std::sqrt(sum / double(result.balls.size()));
}

/// Without the scale, which is common to all balls.
double measured_rms(const PhantomResult& result) {
  double sum = 0;
  for (const Eigen::Matrix3d& covariance : phantom::ball_covariances(result.calibrator))
    sum += covariance.trace();
  return std::sqrt(sum / double(result.balls.size()));
}

std::string summary(const PhantomResult& result) {
  if (result.failure)
    return fmt::format("<p><span class=\"state refused\">refused: {}</span></p>\n<p>{}</p>\n",
                       code(result.failure->reason), report::escaped(result.failure->message));
  std::string html = "<p><span class=\"state ok\">measured</span></p>\n<div class=\"cards\">\n";
  const auto card = [&](const std::string& value, const std::string& what) {
    html += fmt::format("<div class=\"card\"><b>{}</b><span>{}</span></div>\n", value, what);
  };
  card(fmt::format("{:.3f} px", result.rms_px), "reprojection error, rms per axis");
  card(fmt::format("{:.3f} mm", measured_rms(result)),
       "sigma of a ball's centre, root of the sum over the axes");
  card(fmt::format("{:.2g} %", 100 * result.scale.relative_sigma),
       fmt::format("sigma of the scale, estimated from the {}", report::escaped(result.scale.source)));
  card(fmt::format("{:.0f} / {}", result.chi2, result.dof), "chi-square / degrees of freedom");
  html += "</div>\n";
  return html + fmt::format(
                    "<p>The distance that would determine the scale best: {} to {}, about {:.1f} mm. "
                    "Measured with a caliper, it gives the scale with a sigma of {:.2g} %.</p>\n",
                    report::escaped(result.balls[result.pair.a].label),
                    report::escaped(result.balls[result.pair.b].label), result.pair.distance_mm,
                    100 * result.pair.relative_sigma);
}

std::string warnings(const PhantomResult& result) {
  if (result.warnings.empty()) return "";
  std::string html = "<h2>Warnings</h2>\n<ul>\n";
  for (const Warning& w : result.warnings)
    html += fmt::format("<li>{}: {}{}{}</li>\n", code(w.reason), report::escaped(w.view),
                        w.view.empty() ? "" : ": ", report::escaped(w.message));
  return html + "</ul>\n";
}

std::string notes(const PhantomResult& result) {
  if (result.notes.empty()) return "";
  std::string html = "<h2>Notes</h2>\n<ul>\n";
  for (const Warning& note : result.notes)
    html += fmt::format("<li>{}: {}</li>\n", code(note.reason), report::escaped(note.message));
  return html + "</ul>\n";
}

/// A view's image with its balls, whose residuals are arrows, 300 times enlarged.
std::string view_figure(const MeasuredView& view, const std::vector<MeasuredBall>& balls) {
  constexpr double enlarged = 300;
  std::vector<std::pair<Vector2d, Vector2d>> arrows;
  Vector2d low = Vector2d::Constant(1e300), high = -low;
  for (std::size_t i = 0; i < view.residuals_px.size(); ++i) {
    arrows.emplace_back(view.images_px[i], view.residuals_px[i].second);
    low = low.cwiseMin(arrows.back().first);
    high = high.cwiseMax(arrows.back().first);
  }
  if (arrows.empty()) return "";
  const Vector2d margin = 0.12 * (high - low) + Vector2d(30, 30);
  low -= margin;
  high += margin;
  std::string svg = fmt::format(
      "<figure><svg viewBox=\"{:.0f} {:.0f} {:.0f} {:.0f}\"><image x=\"-0.5\" y=\"-0.5\" width=\"{}\" "
      "height=\"{}\" href=\"data:image/png;base64,{}\"/>",
      low.x(), low.y(), high.x() - low.x(), high.y() - low.y(), view.width, view.height,
      report::base64(image::encode_png(view.shown)));
  const double unit = (high - low).maxCoeff() / 600;
  for (std::size_t i = 0; i < arrows.size(); ++i) {
    const auto& [at, residual] = arrows[i];
    const Vector2d tip = at + enlarged * residual;
    const std::size_t ball = view.residuals_px[i].first;
    svg += fmt::format(
        "<circle class=\"ball\" stroke-width=\"{:.2f}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/><path "
        "class=\"residual\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/><text font-size=\"{:.1f}\" x=\"{:.1f}\" "
        "y=\"{:.1f}\">{}</text>",
        unit, at.x(), at.y(), 9 * unit, at.x(), at.y(), tip.x(), tip.y(), 14 * unit, at.x() + 11 * unit,
        at.y() - 7 * unit, ball < balls.size() ? report::escaped(balls[ball].label) : "");
  }
  return svg + fmt::format(
                   "</svg><figcaption>{}: residuals, magnified {:g} times; {:.3f} px rms per axis{}"
                   "</figcaption></figure>\n",
                   report::escaped(view.name), enlarged, view.rms_px,
                   view.left_out_rms_px
                       ? fmt::format(", {:.3f} px when predicted from the other views", *view.left_out_rms_px)
                       : "");
}

report::Table views_table(const std::vector<MeasuredView>& views) {
  using View = MeasuredView;
  return report::without_empty_columns(report::table_of<View>(
      "Views",
      {{{"View", "Name of the X-ray view"}, [](const View& v) { return report::Cell{v.name}; }},
       {{"Balls", "Balls that the view shows", true},
        [](const View& v) { return report::Cell{std::to_string(v.residuals_px.size())}; }},
       {{"Residual rms, px", "Distance of the balls from their projections per axis, px", true},
        [](const View& v) { return report::Cell{report::fixed(v.rms_px, 3)}; }},
       {{"Left out, px", "The same for the phantom as measured by the other views, px", true},
        [](const View& v) { return report::Cell{report::fixed(v.left_out_rms_px, 3)}; }}},
      views));
}

std::string views_section(const PhantomResult& result) {
  if (result.views.empty()) return "";
  std::string figures;
  for (const MeasuredView& view : result.views) figures += view_figure(view, result.balls);
  return "<h2>Views</h2>\n" + html_of(views_table(result.views)) +
         "<p class=\"soft\">left out: the phantom is measured by the other views, which then predict this "
         "one's "
         "images.</p>\n<div class=\"views\">" +
         figures + "</div>\n";
}

report::Table balls_table(const PhantomResult& result) {
  using Ball = MeasuredBall;
  const auto number = [](const char* title, const char* definition, auto value) {
    return report::ColumnOf<Ball>{{title, definition, true},
                                  [value](const Ball& b) { return report::Cell{value(b)}; }};
  };
  const auto along = [&](const char* title, Eigen::Index i) {
    return number(title, "Position in the phantom's frame, mm",
                  [i](const Ball& b) { return report::fixed(b.centre[i], 3); });
  };
  const auto off = [&](const char* title, Eigen::Index i) {
    return number(title, "Measured less nominal position, mm", [i](const Ball& b) {
      return b.from_nominal ? report::fixed((*b.from_nominal)[i], 3) : "–";
    });
  };
  const double limit = off_by * tolerance_of(result);
  const std::string remark = fmt::format("off by more than {:g} x {:g} mm", off_by, tolerance_of(result));
  return report::without_empty_columns(report::table_of<Ball>(
      "Balls",
      {{{"Ball", "Label of the ball"}, [](const Ball& b) { return report::Cell{b.label}; }},
       along("x, mm", 0),
       along("y, mm", 1),
       along("z, mm", 2),
       number("σ, mm", "Standard deviation of the position, mean of the axes, mm",
              [](const Ball& b) { return report::fixed(std::sqrt(b.covariance_mm2.trace() / 3), 4); }),
       number("Views", "Views that show the ball", [](const Ball& b) { return std::to_string(b.views); }),
       off("dx, mm", 0),
       off("dy, mm", 1),
       off("dz, mm", 2),
       number("From nominal, mm", "Length of that difference, mm",
              [](const Ball& b) { return b.from_nominal ? report::fixed(b.from_nominal->norm(), 3) : "–"; }),
       {{"Remark", "A ball whose position is far from nominal"},
        [limit, remark](const Ball& b) {
          return b.from_nominal && b.from_nominal->cwiseAbs().maxCoeff() > limit ? report::Cell{remark, true}
                                                                                 : report::Cell{};
        }}},
      result.balls));
}

std::string balls_section(const PhantomResult& result) {
  return result.balls.empty() ? "" : "<h2>Balls</h2>\n" + html_of(balls_table(result));
}

/// The phantom seen along an axis, with the differences from nominal as arrows.
std::string arrows_figure(const PhantomResult& result, Eigen::Index across, Eigen::Index up,
                          const char* caption) {
  const double enlarged = std::clamp(8 / std::max(0.02, nominal_rms(result)), 1.0, 100.0);
  Vector2d low = Vector2d::Constant(1e300), high = -low;
  const auto at = [&](const Vector3d& p) { return Vector2d(p[across], -p[up]); };
  for (const MeasuredBall& ball : result.balls) {
    low = low.cwiseMin(at(ball.centre));
    high = high.cwiseMax(at(ball.centre));
  }
  low.array() -= 18;
  high.array() += 18;
  std::string svg = fmt::format("<figure class=\"plain\"><svg viewBox=\"{:.2f} {:.2f} {:.2f} {:.2f}\">",
                                low.x(), low.y(), high.x() - low.x(), high.y() - low.y());
  for (const MeasuredBall& ball : result.balls) {
    const Vector2d from = at(ball.centre - *ball.from_nominal);
    const Vector2d to = from + enlarged * at(*ball.from_nominal);
    svg += fmt::format(
        "<circle class=\"field\" stroke-width=\"0.4\" cx=\"{:.2f}\" cy=\"{:.2f}\" r=\"2\"/><path "
        "class=\"residual\" style=\"stroke-width:0.8\" d=\"M{:.2f} {:.2f}L{:.2f} {:.2f}\"/>"
        "<text font-size=\"4\" x=\"{:.2f}\" y=\"{:.2f}\">{}</text>",
        from.x(), from.y(), from.x(), from.y(), to.x(), to.y(), from.x() + 3, from.y() - 2,
        report::escaped(ball.label));
  }
  return svg + fmt::format(
                   "</svg><figcaption>Seen {}. Displacement from the nominal position, magnified {:.0f} "
                   "times</figcaption></figure>\n",
                   caption, enlarged);
}

std::string nominal_section(const PhantomResult& result) {
  if (result.balls.empty() || !result.nominal) return "";
  const std::vector<Vector3d> centres = centres_of(result);
  const Vector3d mean = mean_of(centres);
  double extent = 0;
  for (const Vector3d& centre : centres) extent = std::max(extent, (centre - mean).norm());
  struct Place {
    const char* name;
    Vector3d point;
  };
  const auto with_nominal = [&](const Place& at) {
    return report::Cell{report::fixed(predicted_tre_mm(centres, nominal_rms(result), at.point), 3)};
  };
  const auto with_measured = [&](const Place& at) {
    return report::Cell{report::fixed(std::hypot(predicted_tre_mm(centres, measured_rms(result), at.point),
                                                 result.scale.relative_sigma * (at.point - mean).norm()),
                                      3)};
  };
  const report::Table table = report::table_of<Place>(
      "Effect",
      {{{"Point", "Position relative to the balls"}, [](const Place& at) { return report::Cell{at.name}; }},
       {{"Nominal file, mm", "rms error with the nominal coordinates, mm", true}, with_nominal},
       {{"Measured file, mm", "rms error with the measured coordinates, mm", true}, with_measured}},
      {{"middle of the balls", mean},
       {"at the farthest ball's distance, along x", mean + Vector3d(extent, 0, 0)},
       {"at the farthest ball's distance, along z", mean + Vector3d(0, 0, extent)}});
  return "<h2>From nominal</h2>\n<div class=\"views\">" +
         arrows_figure(result, 0, 2, "along y: x to the right, z up") +
         arrows_figure(result, 0, 1, "along z: x to the right, y up") +
         "</div>\n<h2>Effect of the balls' errors on a located point</h2>\n" + html_of(table) +
         "<p class=\"soft\">rms error caused by the errors of the coordinates alone, taken as independent "
         "(Fitzpatrick, West and Maurer 1998). Image noise adds to it.</p>\n";
}

}  // namespace

double predicted_tre_mm(const std::vector<Vector3d>& balls, double ball_rms_mm, const Vector3d& point) {
  const Vector3d mean = mean_of(balls);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& ball : balls) spread += (ball - mean) * (ball - mean).transpose();
  const auto [values, vectors] = geometry::symmetric_eigen(spread / double(balls.size()));
  double sum = 0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const Vector3d axis = vectors.col(k);
    const double about = (point - mean).squaredNorm() - std::pow(axis.dot(point - mean), 2);
    const double balls_about = values.sum() - values[k];
    sum += about / balls_about / 3;
  }
  return ball_rms_mm * std::sqrt((1 + sum) / double(balls.size()));
}

std::string phantom_report_html(const PhantomResult& result) {
  return report::page_html("helicarm phantom", "Phantom " + result.calibrator.name,
                           summary(result) + warnings(result) + notes(result) + nominal_section(result) +
                               balls_section(result) + views_section(result),
                           ". Millimetres and pixels.");
}

Expected<void> write_phantom(const PhantomResult& result, const std::filesystem::path& folder) {
  return guarded([&] {
    if (!result.failure)
      value_or_throw(
          write_file(folder / "calibrator.json", to_text(phantom::to_json(result.calibrator)) + "\n"));
    value_or_throw(write_file(folder / "report.html", phantom_report_html(result)));
    value_or_throw(write_file(folder / "result.json", to_text(to_json(result)) + "\n"));
  });
}

}  // namespace helicarm::phantom_calibration

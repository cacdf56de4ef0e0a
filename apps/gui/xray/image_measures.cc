// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/image_measures.h"

#include <QObject>
#include <algorithm>
#include <cmath>

#include "gui/xray/text.h"
#include "helicarm/core/statistics.h"

namespace helicarm::gui {
namespace {

using measures::Kind;

QString unit_of(const measures::Quantity& quantity) {
  return quantity.unit == "deg" ? QStringLiteral("°") : " " + text(quantity.unit);
}

int digits_of(const measures::Quantity& quantity) { return quantity.unit == "mm" ? 2 : 1; }

QString value_of(const measures::Quantity& quantity) {
  return fixed(quantity.value, digits_of(quantity)) + unit_of(quantity);
}

QString within_of(const measures::Quantity& quantity) {
  if (!quantity.sigma) return {};
  return "±" + fixed(normal_at_975 * *quantity.sigma, digits_of(quantity)) + unit_of(quantity);
}

QString words_of(std::string_view name) {
  if (name == "length") return QObject::tr("length");
  if (name == "angle") return QObject::tr("angle");
  if (name == "diameter") return QObject::tr("diameter");
  if (name == "residual_rms") return QObject::tr("residual of the clicks, rms");
  if (name == "condyle_depth") return QObject::tr("depth of the condyle (100 %)");
  if (name == "condyle_height") return QObject::tr("height of the condyle (100 %)");
  if (name == "sagittal_diameter") return QObject::tr("sagittal diameter (100 %)");
  if (name == "width") return QObject::tr("width (100 %)");
  if (name == "depth") return QObject::tr("depth");
  if (name == "height") return QObject::tr("height");
  if (name == "from_anterior") return QObject::tr("from anterior");
  if (name == "from_medial") return QObject::tr("from medial");
  return text(name);
}

bool is_of_other_bone(const pipeline::PointResult& point, Kind kind) {
  return point.moves_with == (kind == Kind::femoral_quadrants ? "tibia" : "femur");
}

measures::Click with_sigma(std::string name, const Eigen::Vector2d& uv, double sigma_px) {
  return {std::move(name), uv, sigma_px * sigma_px * Eigen::Matrix2d::Identity()};
}

/// A picked point's image; where its rays miss each other, the projection of the located point, whose
/// covariance holds the contradiction.
std::optional<measures::Click> click_of(const pipeline::PointResult& point, const pipeline::ViewResult& view,
                                        std::size_t index) {
  if (!point.rays_miss || !point.place || !view.calibrated)
    return with_sigma(point.name, point.seen[index]->uv, point.seen[index]->sigma_px);
  const auto click = measures::click_of(point.name, point.place->in_calibrator,
                                        point.place->covariance_in_calibrator, view.calibrated->view);
  return click ? std::optional(*click) : std::nullopt;
}

Expected<std::vector<measures::Click>> clicks_of(const ImageMeasure& measure, const pipeline::Result& result,
                                                 std::size_t index) {
  const pipeline::ViewResult& view = result.views[index];
  std::vector<measures::Click> clicks;
  for (const RawClick& click : measure.clicks) {
    if (!view.rectification) {
      clicks.push_back(with_sigma(click.name, click.raw, fiducials::click_sigma_px));
      continue;
    }
    const auto seen = fiducials::point_of_click(view.rectification->map, click.raw, {});
    if (!seen) return tl::unexpected<Failure>(seen.error());
    clicks.push_back(with_sigma(click.name, seen->uv, seen->sigma_px));
  }
  if (measures::info_of(measure.kind).further != measures::Further::points) return clicks;
  for (const pipeline::PointResult& point : result.points) {
    const bool is_new = std::ranges::find(clicks, point.name, &measures::Click::name) == clicks.end();
    if (!is_new || index >= point.seen.size() || !point.seen[index] ||
        point.source != localization::PointSource::pick || is_of_other_bone(point, measure.kind))
      continue;
    if (const auto click = click_of(point, view, index)) clicks.push_back(*click);
  }
  return clicks;
}

Expected<std::optional<measures::ObjectPlane>> plane_of(const LengthPlane& plane,
                                                        const pipeline::Result& result,
                                                        const pipeline::ViewResult& view) {
  const auto given = [](measures::ObjectPlane found) { return std::optional(std::move(found)); };
  if (!view.calibrated) return std::nullopt;
  if (plane.depth_mm) return given(measures::plane_at(*view.calibrated, *plane.depth_mm, 0));
  for (const pipeline::PointResult& point : result.points)
    if (point.name == plane.point && point.place)
      return measures::plane_through(*view.calibrated, point.place->in_calibrator,
                                     point.place->covariance_in_calibrator)
          .map(given);
  phantom::Calibrator calibrator;
  calibrator.balls = result.calibrator.balls;
  if (calibrator.balls.empty()) return std::nullopt;
  return measures::plane_through(*view.calibrated, phantom::middle_of(calibrator)).map(given);
}

void add_results(EvaluatedMeasure& done, const MeasuredLine& head, const measures::Measure& measure,
                 const std::vector<measures::Click>& clicks) {
  for (const measures::Quantity& quantity : measure.quantities) {
    MeasuredLine line = head;
    line.what = words_of(quantity.name);
    line.value = value_of(quantity);
    line.within = within_of(quantity);
    done.lines.push_back(line);
  }
  const auto components = measures::info_of(measure.kind).components;
  for (const measures::Position& position : measure.positions) {
    QStringList all;
    for (std::size_t i = 0; i < components.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      MeasuredLine line = head;
      line.what = text(position.point) + ", " + words_of(components[i]);
      line.value = fixed(position.percent[at], 1) + " %";
      line.within = "±" + fixed(normal_at_975 * std::sqrt(position.covariance(at, at)), 1) + " %";
      all << line.value;
      done.lines.push_back(line);
    }
    for (const Warning& warning : position.warnings) {
      MeasuredLine line = head;
      line.what = QString::fromStdString(warning.message);
      done.lines.push_back(line);
    }
    const auto click = std::ranges::find(clicks, position.point, &measures::Click::name);
    done.positions.emplace_back(click->uv, text(position.point) + ": " + all.join(", "));
  }
  if (components.empty())
    done.label = value_of(measure.quantities.front()) + " " + within_of(measure.quantities.front());
}

}  // namespace

const measures::Role* next_role(const ImageMeasure& measure) {
  return is_complete(measure) ? nullptr : &measures::info_of(measure.kind).roles[measure.clicks.size()];
}

std::size_t required_clicks(const ImageMeasure& measure) {
  const auto roles = measures::info_of(measure.kind).roles;
  return measure.without_optional
             ? std::size_t(std::ranges::count(roles, false, &measures::Role::is_optional))
             : roles.size();
}

bool is_complete(const ImageMeasure& measure) { return measure.clicks.size() >= required_clicks(measure); }

bool takes_clicks(const ImageMeasure& measure) {
  return !is_complete(measure) || measures::info_of(measure.kind).further != measures::Further::refused;
}

EvaluatedMeasure evaluated(const ImageMeasure& measure, const pipeline::Result& result,
                           const LengthPlane& plane) {
  const auto view = std::ranges::find_if(result.views, [&](const pipeline::ViewResult& one) {
    return one.xray_image && one.xray_image->acquisition.instance_key == measure.image;
  });
  if (view == result.views.end()) return {};
  const MeasuredLine head{
      measure.number, text(measures::info_of(measure.kind).brief), text(view->name), {}, {}, {}};
  EvaluatedMeasure done{measure.image, measure.number};
  const auto refused = [&](const Failure& why) {
    MeasuredLine line = head;
    line.what = QString::fromStdString(why.message);
    done.lines = {line};
    return done;
  };
  const auto clicks = clicks_of(measure, result, std::size_t(view - result.views.begin()));
  if (!clicks) return refused(clicks.error());
  for (std::size_t i = 0; i < measure.clicks.size(); ++i) done.points.push_back((*clicks)[i].uv);
  if (!is_complete(measure)) return done;
  const auto in_plane = plane_of(plane, result, *view);
  if (!in_plane) return refused(in_plane.error());
  const auto found = measures::measure(measure.kind, *clicks, *in_plane);
  if (!found) return refused(found.error());
  done.strokes = measures::drawing_of(measure.kind, *clicks);
  add_results(done, head, *found, *clicks);
  return done;
}

QString table_text(const std::vector<MeasuredLine>& lines) {
  QString all = QStringList{QObject::tr("number"), QObject::tr("measure"), QObject::tr("view"),
                            QObject::tr("what"),   QObject::tr("value"),   QObject::tr("95 %")}
                    .join('\t');
  for (const MeasuredLine& line : lines)
    all += '\n' +
           QStringList{QString::number(line.number), line.kind, line.view, line.what, line.value, line.within}
               .join('\t');
  return all + '\n';
}

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/registration_tables.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/measures/measure_json.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/tables.h"

namespace helicarm::case_registration {
namespace {

using registration::RegisteredView;

struct NamedPoint {
  const RegisteredModel* model;
  const RegisteredPoint* point;
};

report::ColumnOf<NamedPoint> coordinate(const char* title, Eigen::Index i) {
  return {{title, "Position in the calibrator's frame, mm", true}, [i](const NamedPoint& row) {
            return report::Cell{report::fixed(row.point->place.in_calibrator[i], 2)};
          }};
}

}  // namespace

report::Table models_table(const std::vector<RegisteredModel>& models) {
  using Model = RegisteredModel;
  const auto pose = [](auto value, int digits) {
    return [value, digits](const Model& m) {
      if (!m.registration.is_determined()) return report::Cell{};
      return report::Cell{report::coordinates(Eigen::Vector3d(value(m.registration)), digits)};
    };
  };
  using registration::Registration;
  const auto centre = [](const Registration& r) { return r.centre; };
  const auto sigma = [](const Registration& r) -> Eigen::Matrix<double, 6, 1> {
    return r.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  };
  const auto centre_sigma = [sigma](const Registration& r) -> Eigen::Vector3d { return sigma(r).tail<3>(); };
  const auto rotation_sigma = [sigma](const Registration& r) -> Eigen::Vector3d {
    return sigma(r).head<3>() * 180 / EIGEN_PI;
  };
  const auto agreement = [](const Model& m) {
    std::string scores;
    for (const RegisteredView& view : m.registration.views)
      scores += (scores.empty() ? "" : ", ") + report::fixed(view.score, 3);
    return report::Cell{scores};
  };
  const auto starts = [](const Model& m) {
    return m.by_landmarks_only
               ? report::Cell{}
               : report::Cell{fmt::format("{} of {}", m.registration.agree, m.registration.starts)};
  };
  return report::table_of<Model>(
      "Models",
      {{{"Model", "Name of the model in case.json"},
        [](const Model& m) { return report::Cell{m.registration.name}; }},
       {{"Decision", "accept, warn or refuse"},
        [](const Model& m) {
          return report::Cell{std::string(registration::word(m.registration.decision)),
                              m.registration.failure.has_value()};
        }},
       {{"Agreement", "With each view's image, at most 1"}, agreement},
       {{"Centre x, y, z, mm", "Position of the model's centre in the calibrator's frame, mm"},
        pose(centre, 2)},
       {{"Centre σ, mm", "Standard deviation of the centre along the calibrator's x, y, z, mm"},
        pose(centre_sigma, 3)},
       {{"Rotation σ, °", "Standard deviation of the rotation about the calibrator's x, y, z, degrees"},
        pose(rotation_sigma, 3)},
       {{"Starts", "Starting poses that led to this result, of all"}, starts}},
      models);
}

report::Table views_table(const registration::Registration& of) {
  return report::table_of<RegisteredView>(
      "Views",
      {{{"View", "Name of the X-ray view"}, [](const RegisteredView& v) { return report::Cell{v.name}; }},
       {{"Agreement", "Correlation of the image's patches with the model's, 1 at best", true},
        [](const RegisteredView& v) { return report::Cell{report::fixed(v.score, 3)}; }},
       {{"Residual, px", "Shift that a patch of the image would still make, root mean square, px", true},
        [](const RegisteredView& v) { return report::Cell{report::fixed(v.residual_px, 2)}; }},
       {{"Other views, mm", "Distance between this view's pose and the others', along what both can see, mm",
         true},
        [](const RegisteredView& v) { return report::Cell{report::fixed(v.held_out_mm, 2)}; }},
       {{"Comparisons", "Patches or contour points compared", true},
        [](const RegisteredView& v) { return report::Cell{std::to_string(v.comparisons)}; }}},
      of.views);
}

report::Table points_table(const std::vector<RegisteredModel>& models) {
  std::vector<NamedPoint> rows;
  for (const RegisteredModel& model : models)
    for (const RegisteredPoint& point : model.points) rows.push_back({&model, &point});
  return report::table_of<NamedPoint>(
      "Planned points",
      {{{"Planned point", "Name of the point in the model's plan"},
        [](const NamedPoint& row) { return report::Cell{row.point->name}; }},
       {{"Model", "Name of the model in case.json"},
        [](const NamedPoint& row) { return report::Cell{row.model->registration.name}; }},
       {{"±95 %, mm", "Predicted error (TRE): length that 95 % of the errors do not exceed, mm", true},
        [](const NamedPoint& row) {
          return report::Cell{
              report::fixed(localization::length_at_95(row.point->place.covariance_in_calibrator), 2)};
        }},
       coordinate("x, mm", 0),
       coordinate("y, mm", 1),
       coordinate("z, mm", 2)},
      rows);
}

namespace {

struct MeasureRow {
  std::string measure, point, where, position, published;
  bool is_bad = false;
};

std::string without_point(measures::Kind kind, const measures::Position& position) {
  return measures::sentence_of(kind, position).substr(position.point.size() + 1);
}

MeasureRow row_in_space(const measures::InBone& of, std::size_t i, const std::string& measure) {
  const measures::Position& position = of.measure.positions[i];
  MeasureRow row{measure, position.point, "in space", without_point(of.measure.kind, position), ""};
  for (const measures::ZoneFit& fit : of.zones[i]) {
    row.published += (row.published.empty() ? "" : "; ") + measures::sentence_of(fit, of.measure.kind);
    row.is_bad = row.is_bad || fit.is_outside;
  }
  for (const Warning& warning : position.warnings) {
    row.published += (row.published.empty() ? "" : "; ") + warning.message;
    row.is_bad = true;
  }
  return row;
}

void add_rows(const measures::InBone& of, std::vector<MeasureRow>& rows) {
  const measures::Kind kind = of.measure.kind;
  const std::string measure = fmt::format("{} ({}, {})", of.name, measures::info_of(kind).label, of.model);
  for (std::size_t i = 0; i < of.measure.positions.size(); ++i) rows.push_back(row_in_space(of, i, measure));
  for (const measures::LateralView& view : of.laterals) {
    rows.push_back({measure, "", view.view, "", measures::sentence_of(view), !view.is_lateral});
    for (const measures::Position& position : view.projected)
      rows.push_back({measure, position.point, view.view + ", images of the landmarks",
                      without_point(kind, position), ""});
  }
  for (const measures::InImage& image : of.clicked)
    for (const measures::Position& position : image.positions)
      rows.push_back({measure, position.point, image.view + ", clicked", without_point(kind, position), ""});
  for (const std::string& name : of.missing) rows.push_back({measure, name, "", "", "not located", true});
}

}  // namespace

report::Table measures_table(const std::vector<RegisteredModel>& models) {
  std::vector<MeasureRow> rows;
  for (const RegisteredModel& model : models)
    for (const measures::InBone& measure : model.measures) add_rows(measure, rows);
  const auto shown = [](std::string MeasureRow::*text) {
    return [text](const MeasureRow& row) { return report::Cell{row.*text}; };
  };
  return report::table_of<MeasureRow>(
      "Quadrants and per cent",
      {{{"Measure", "Name in the table of landmarks, what is measured, and the model"},
        shown(&MeasureRow::measure)},
       {{"Point", "Planned or located point"}, shown(&MeasureRow::point)},
       {{"Where",
         "In space: in the parallel projection along the bone's axis. A view: in its image, of the "
         "landmarks' images or as clicked"},
        shown(&MeasureRow::where)},
       {{"Position", "Per cent with their standard deviations"}, shown(&MeasureRow::position)},
       {{"Remarks", "Published positions and their sources; whether the view is a lateral one"},
        [](const MeasureRow& row) {
          return report::Cell{row.published, row.is_bad};
        }}},
      rows);
}

report::Table tunnels_in_bone_table(const std::vector<RegisteredModel>& models) {
  std::vector<report::TunnelInBoneRow> rows;
  for (const RegisteredModel& model : models)
    for (std::size_t i = 0; i < std::min(model.tunnels.size(), model.bone_checks.size()); ++i)
      if (model.bone_checks[i])
        rows.push_back({model.tunnels[i].name, model.registration.name, *model.bone_checks[i]});
  return report::bone_table(rows);
}

}  // namespace helicarm::case_registration

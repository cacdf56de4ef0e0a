// SPDX-License-Identifier: Apache-2.0
#include "gui/window/plan_tables.h"

#include <QStringList>
#include <algorithm>
#include <limits>

#include "gui/controller/steps.h"
#include "gui/window/page_parts.h"
#include "gui/window/pages.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/report/markup.h"
#include "helicarm/report/tables.h"

namespace helicarm::gui {
namespace {

using case_registration::RegisteredModel;
using guidance::PointInFrames;
using report::Cell;

QString words_of(const pipeline::BoneLabel& bone) {
  if (!bone.side) return text(bone.name);
  return (*bone.side == pipeline::Side::left ? PlanPage::tr("left %1") : PlanPage::tr("right %1"))
      .arg(text(bone.name));
}

std::string views_with(const ApplicationState& state, const std::string& point) {
  QStringList views;
  for (const std::string& view : state.views)
    if (pick_of(state, point, view) != nullptr) views << text(view);
  return views.join(", ").toStdString();
}

pipeline::PointResult located(const ApplicationState& state, const PlannedPoint& planned) {
  if (!planned.of_model && state.result) {
    const auto& points = state.result->points;
    const auto found = std::ranges::find(points, planned.name, &pipeline::PointResult::name);
    if (found != points.end()) return *found;
  }
  pipeline::PointResult point;
  point.name = planned.name;
  point.source = localization::PointSource::pick;
  if (planned.of_model) {
    point.place = planned.of_model->place;
    point.ray_gap_mm = std::numeric_limits<double>::quiet_NaN();  // no rays
  }
  return point;
}

PlanTunnelRow row_of(const std::string& name, const std::string& planned_by, bool is_of_model,
                     const PointInFrames& start, const PointInFrames& end) {
  return {name,
          planned_by,
          is_of_model,
          (end.in_calibrator - start.in_calibrator).norm(),
          localization::length_at_95(start.covariance_in_calibrator),
          localization::length_at_95(end.covariance_in_calibrator)};
}

report::ColumnOf<PlanTunnelRow> number_column(const char* title, const char* definition,
                                              double PlanTunnelRow::*member, int digits) {
  return {{title, definition, true},
          [=](const PlanTunnelRow& row) { return Cell{report::fixed(row.*member, digits)}; }};
}

}  // namespace

report::Table ends_table(const ApplicationState& state, const std::vector<PlannedPoint>& planned) {
  std::vector<pipeline::PointResult> points;
  for (const PlannedPoint& each : planned) points.push_back(located(state, each));
  const auto kind = [&](const PlannedPoint& point) {
    const auto bone = point.of_model ? std::nullopt : bone_of(state, point.name);
    return Cell{(bone ? point.kind + ", " + words_of(*bone) : point.kind).toStdString()};
  };
  const auto views = [&](const PlannedPoint& point) {
    return point.of_model ? Cell{""} : Cell{views_with(state, point.name)};
  };
  return report::beside(
      report::table_of<PlannedPoint>(
          "",
          {{{"Point", "Name of the tunnel end, landmark, check target or planned point"},
            [](const PlannedPoint& point) { return Cell{point.name}; }},
           {{"Is",
             "enters: where the drill enters; ends: where it stops; landmark; target; plan: of a registered "
             "model"},
            kind},
           {{"Clicked in", "Views in which it is picked"}, views}},
          planned),
      report::positions_table(points));
}

std::vector<const RegisteredModel*> usable_models(const ApplicationState& state) {
  std::vector<const RegisteredModel*> models;
  if (!state.registration) return models;
  for (const RegisteredModel& model : state.registration->models)
    if (!model.registration.failure) models.push_back(&model);
  return models;
}

std::vector<PlanTunnelRow> plan_tunnels(const ApplicationState& state) {
  std::vector<PlanTunnelRow> rows;
  if (state.result) {
    const pipeline::Result& result = *state.result;
    for (std::size_t i = 0; i < std::min(result.tunnels.size(), result.tunnel_ends.size()); ++i) {
      const auto& start = result.points[result.tunnel_ends[i].start].place;
      const auto& end = result.points[result.tunnel_ends[i].end].place;
      if (start && end)
        rows.push_back(
            row_of(result.tunnels[i].name, PlanPage::tr("picks").toStdString(), false, *start, *end));
    }
  }
  for (const RegisteredModel* model : usable_models(state))
    for (std::size_t i = 0; i < model->tunnels.size(); ++i)
      rows.push_back(row_of(model->tunnels[i].name,
                            PlanPage::tr("plan of %1").arg(text(model->registration.name)).toStdString(),
                            true, model->points[model->tunnel_ends[i].start].place,
                            model->points[model->tunnel_ends[i].end].place));
  return rows;
}

report::Table plan_tunnels_table(const std::vector<PlanTunnelRow>& tunnels) {
  constexpr const char* bound = "Length that 95 % of the errors of that end do not exceed, mm";
  return report::table_of<PlanTunnelRow>(
      "",
      {{{"Tunnel", "Name of the tunnel"}, [](const PlanTunnelRow& row) { return Cell{row.name}; }},
       {{"Planned by", "picks: in the X-ray images; plan: of a registered model"},
        [](const PlanTunnelRow& row) { return Cell{row.planned_by}; }},
       number_column("Length, mm", "Distance from start to end, mm", &PlanTunnelRow::length_mm, 2),
       number_column("Start ±95 %, mm", bound, &PlanTunnelRow::start_95_mm, 3),
       number_column("End ±95 %, mm", bound, &PlanTunnelRow::end_95_mm, 3)},
      tunnels);
}

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#include "gui/window/plan_tables.h"

#include <QStringList>
#include <algorithm>
#include <limits>

#include "gui/controller/stale.h"
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
    if (const pipeline::Pick* pick = pick_of(state, point, view); pick != nullptr)
      views << (failure_of(state, point, view) != nullptr ? PlanPage::tr("%1 (failed)").arg(text(view))
                : pick->snap == pipeline::Snap::ball      ? PlanPage::tr("%1 (ball)").arg(text(view))
                                                          : text(view));
  return views.join(", ").toStdString();
}

pipeline::PointResult located(const ApplicationState& state, const PlannedPoint& planned) {
  if (!planned.of_model && state.result && !is_stale(state, planned.name) &&
      stale(state, Phase::calibrate).isEmpty()) {
    const auto& points = state.result->points;
    const auto found = std::ranges::find(points, planned.name, &pipeline::PointResult::name);
    if (found != points.end()) return *found;
  }
  pipeline::PointResult point;
  point.name = planned.name;
  point.source = localization::PointSource::pick;
  if (planned.of_model && planned.out_of_date.isEmpty()) {
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

/// Why a row has no numbers that is not a reason of the result; empty where it has, or needs none.
QString remark_of(const ApplicationState& state, const PlannedPoint& planned) {
  if (planned.of_model) return planned.out_of_date;
  for (const std::string& view : state.views)
    if (const Failure* failed = failure_of(state, planned.name, view)) return sentence_of(*failed);
  if (!state.result || !is_picked(state.picks, state.views, planned.name)) return {};
  if (is_stale(state, planned.name)) return PlanPage::tr("not measured with these picks yet");
  return stale(state, Phase::calibrate);
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
  report::Table table = report::beside(
      report::table_of<PlannedPoint>(
          "",
          {{{"Point", "Name of the tunnel end, landmark, check target or planned point"},
            [](const PlannedPoint& point) { return Cell{point.name}; }},
           {{"Is",
             "start or end of a tunnel, and where the drill enters; landmark; target; plan: of a registered "
             "model"},
            kind},
           {{"Clicked in", "Views in which it is picked"}, views}},
          planned),
      report::positions_table(points));
  for (std::size_t i = 0; i < planned.size(); ++i)
    if (const QString remark = remark_of(state, planned[i]); !remark.isEmpty())
      table.rows[i].back() = Cell{remark.toStdString(), true};
  return table;
}

std::vector<UsableModel> usable_models(const ApplicationState& state) {
  std::vector<UsableModel> models;
  if (!state.registration) return models;
  for (std::size_t i = 0; i < state.registration->models.size(); ++i)
    if (const RegisteredModel& model = state.registration->models[i]; !model.registration.failure)
      models.push_back({&model, stale_model(state, i)});
  return models;
}

std::vector<PlanTunnelRow> plan_tunnels(const ApplicationState& state) {
  std::vector<PlanTunnelRow> rows;
  if (state.result && stale(state, Phase::calibrate).isEmpty()) {
    const pipeline::Result& result = *state.result;
    for (std::size_t i = 0; i < std::min(result.tunnels.size(), result.tunnel_ends.size()); ++i) {
      const pipeline::PointResult &from = result.points[result.tunnel_ends[i].start],
                                  &to = result.points[result.tunnel_ends[i].end];
      const auto &start = from.place, &end = to.place;
      if (start && end && !is_stale(state, from.name) && !is_stale(state, to.name))
        rows.push_back(
            row_of(result.tunnels[i].name, PlanPage::tr("picks").toStdString(), false, *start, *end));
    }
  }
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  for (const auto& [model, out_of_date] : usable_models(state))
    for (std::size_t i = 0; i < model->tunnels.size(); ++i) {
      const QString plan = PlanPage::tr("plan of %1").arg(text(model->registration.name));
      PlanTunnelRow row = row_of(model->tunnels[i].name, plan.toStdString(), true,
                                 model->points[model->tunnel_ends[i].start].place,
                                 model->points[model->tunnel_ends[i].end].place);
      if (!out_of_date.isEmpty()) {
        row.planned_by = PlanPage::tr("%1, out of date").arg(plan).toStdString();
        row.start_95_mm = row.end_95_mm = none;
        if (!stale(state, Phase::calibrate).isEmpty()) row.length_mm = none;  // its file may have changed
      }
      rows.push_back(std::move(row));
    }
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

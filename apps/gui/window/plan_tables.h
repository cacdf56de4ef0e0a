// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <vector>

#include "gui/controller/application_state.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/report/table.h"

namespace helicarm::gui {

/// A tunnel's end, landmark, target or point of a model's plan, and what it is.
struct PlannedPoint {
  std::string name;
  QString kind;
  const case_registration::RegisteredPoint* of_model = nullptr;
  QString out_of_date = {};  ///< why its model's pose is not of the present inputs
};

/// The points as the report shows them, and where each is marked. One without a result has a name only.
report::Table ends_table(const ApplicationState& state, const std::vector<PlannedPoint>& planned);

/// A registered model that is not refused.
struct UsableModel {
  const case_registration::RegisteredModel* model;
  QString out_of_date;  ///< `stale_model`: no number of it holds
};
std::vector<UsableModel> usable_models(const ApplicationState& state);

/// A tunnel between two located points; numbers that do not hold are not a number.
struct PlanTunnelRow {
  std::string name, planned_by;
  bool is_of_model;
  double length_mm, start_95_mm, end_95_mm;
};

/// The picked tunnels with both ends located, then those of the models' plans.
std::vector<PlanTunnelRow> plan_tunnels(const ApplicationState& state);
report::Table plan_tunnels_table(const std::vector<PlanTunnelRow>& tunnels);

}  // namespace helicarm::gui

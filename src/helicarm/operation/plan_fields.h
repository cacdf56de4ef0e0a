// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/case_registration/register_fields.h"
#include "helicarm/core/field.h"
#include "helicarm/operation/plan.h"

namespace helicarm::operation {

namespace description {

/// An option of a run, for the plan's measurements.
template <auto member>
constexpr Field<OperationPlan> run_field(std::string_view name) {
  return bound_as<&OperationPlan::measuring, &case_registration::RegisterOptions::run, member>(
      field_named<pipeline::RunOptions>(pipeline::run_fields, name));
}

/// An option of a registration, for the plan's models.
template <auto member>
constexpr Field<OperationPlan> search_field(std::string_view name) {
  return bound_as<&OperationPlan::measuring, &case_registration::RegisterOptions::search, member>(
      field_named<case_registration::SearchRange>(case_registration::search_fields, name));
}

}  // namespace description

/// The plan's options that a user may set, the limits of plan.json; those with a flag can be stated for one
/// operation.
inline constexpr std::array<Field<OperationPlan>, 17> plan_fields{
    bound<&OperationPlan::max_error_mm>(
        {.name = "max_error_mm",
         .label = "Limit of a point's error",
         .flag = "--max-error",
         .unit = "mm",
         .range = {1e-6, 1000},
         .help = "Neither robot nor drill is guided to a point with a larger 95 % error"}),
    description::run_field<&pipeline::RunOptions::method>("method"),
    description::run_field<&pipeline::RunOptions::motion_sigma_mm>("motion_sigma_mm"),
    description::search_field<&case_registration::SearchRange::shift_mm>("search_mm"),
    description::search_field<&case_registration::SearchRange::turn_deg>("search_deg"),
    bound<&OperationPlan::limits, &PlanLimits::distance_mm>(
        {.name = "plan_stale_mm",
         .label = "Motion since planning",
         .unit = "mm",
         .range = {0.3, 10},
         .help = "The robot does not start, or stops, after a larger motion of bone, robot base or tool"}),
    bound<&OperationPlan::limits, &PlanLimits::turn_deg>(
        {.name = "plan_stale_deg",
         .label = "Rotation since planning",
         .unit = "deg",
         .range = {0.3, 10},
         .help = "The robot does not start, or stops, after a larger rotation of bone, robot base or tool"}),
    bound<&OperationPlan::limits, &PlanLimits::age_s>(
        {.name = "plan_stale_s",
         .label = "Age of a plan",
         .flag = "--plan-age",
         .unit = "s",
         .range = {1, 600},
         .help = "A plan not confirmed within this time expires"}),
    bound<&OperationPlan::tracker, &TrackerPlan::sigma_mm>(
        {.name = "sigma_mm",
         .label = "Tracker error, position",
         .unit = "mm",
         .range = {0, 10},
         .help = "Error of a tracker position averaged over 1 s, per axis"}),
    bound<&OperationPlan::tracker, &TrackerPlan::sigma_deg>(
        {.name = "sigma_deg",
         .label = "Tracker error, rotation",
         .unit = "deg",
         .range = {0, 10},
         .help = "Error of a tracker rotation averaged over 1 s, per axis"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::stand_off_mm>(
        {.name = "stand_off_mm",
         .label = "Stand-off",
         .unit = "mm",
         .range = {1, 500},
         .help =
             "Distance before the tunnel's start at which the tip reaches its axis; greater than the gap"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::gap_mm>(
        {.name = "gap_mm",
         .label = "Gap before the tunnel",
         .unit = "mm",
         .range = {-200, 500},
         .help = "Distance before the tunnel's start at which the tip stops; negative: inside the tunnel"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::travel_mm_s>(
        {.name = "travel_mm_s",
         .label = "Travel speed",
         .unit = "mm/s",
         .range = {0.1, 250},
         .help = "Speed to the stand-off point"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::approach_mm_s>(
        {.name = "approach_mm_s",
         .label = "Approach speed",
         .unit = "mm/s",
         .range = {0.1, 250},
         .help = "Speed along the tunnel's axis"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::corrections,
          &robot::Corrections::most>({.name = "corrections",
                                      .label = "Corrections",
                                      .range = {0, 20},
                                      .step = 1,
                                      .help = "Maximum number of corrections by the tracker"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::corrections,
          &robot::Corrections::tolerance_mm>({.name = "tolerance_mm",
                                              .label = "Position tolerance",
                                              .unit = "mm",
                                              .range = {0.01, 10},
                                              .help = "Greatest position error of the tool at its target"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &robot::ApproachOptions::corrections,
          &robot::Corrections::tolerance_deg>({.name = "tolerance_deg",
                                               .label = "Rotation tolerance",
                                               .unit = "deg",
                                               .range = {0.01, 10},
                                               .help = "Greatest rotation error of the tool at its target"})};

}  // namespace helicarm::operation

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "helicarm/core/field.h"
#include "helicarm/operation/plan.h"

namespace helicarm {

/// The plan's numbers that a person may set; plan.json's limits are these.
inline constexpr std::array<Field<OperationPlan>, 13> plan_fields{
    bound<&OperationPlan::max_error_mm>(
        {.name = "max_error_mm",
         .label = "Limit of a point's error",
         .unit = "mm",
         .range = {1e-6, 1000},
         .help = "The robot goes by no point that may be further off (95 %)"}),
    bound<&OperationPlan::limits, &PlanLimits::distance_mm>(
        {.name = "plan_stale_mm",
         .label = "Motion since planning",
         .unit = "mm",
         .range = {0.3, 10},
         .help = "The robot does not move, or stops, once bone, robot base or tool have moved further"}),
    bound<&OperationPlan::limits, &PlanLimits::turn_deg>({.name = "plan_stale_deg",
                                                          .label = "Turn since planning",
                                                          .unit = "deg",
                                                          .range = {0.3, 10},
                                                          .help = "The same of their turn"}),
    bound<&OperationPlan::limits, &PlanLimits::age_s>(
        {.name = "plan_stale_s",
         .label = "Age of a plan",
         .unit = "s",
         .range = {1, 600},
         .help = "A plan that was not confirmed so long after it was made must be made again"}),
    bound<&OperationPlan::tracker, &TrackerPlan::sigma_mm>(
        {.name = "sigma_mm",
         .label = "Tracker's noise of place",
         .unit = "mm",
         .range = {0, 10},
         .help = "What a second's mean leaves in a reading of the tracker, per axis"}),
    bound<&OperationPlan::tracker, &TrackerPlan::sigma_deg>(
        {.name = "sigma_deg",
         .label = "Tracker's noise of turn",
         .unit = "deg",
         .range = {0, 10},
         .help = "The same of a reading's turn, per axis"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::stand_off_mm>(
        {.name = "stand_off_mm",
         .label = "Stand-off",
         .unit = "mm",
         .range = {1, 500},
         .help = "The tip first goes to the tunnel's axis so far before its start"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::gap_mm>(
        {.name = "gap_mm",
         .label = "Gap before the tunnel",
         .unit = "mm",
         .range = {-200, 500},
         .help = "The tip halts so far before the tunnel's start; negative: within the tunnel"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::travel_mm_s>(
        {.name = "travel_mm_s",
         .label = "Speed of travel",
         .unit = "mm/s",
         .range = {0.1, 250},
         .help = "Speed to the stand-off"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::approach_mm_s>(
        {.name = "approach_mm_s",
         .label = "Speed of approach",
         .unit = "mm/s",
         .range = {0.1, 250},
         .help = "Speed along the axis"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::corrections, &Corrections::most>(
        {.name = "corrections",
         .label = "Corrections",
         .range = {0, 20},
         .step = 1,
         .help = "How many moves by the tracker may follow"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::corrections,
          &Corrections::tolerance_mm>({.name = "tolerance_mm",
                                       .label = "Tolerance of place",
                                       .unit = "mm",
                                       .range = {0.01, 10},
                                       .help = "The tool is there when it is no further off its place"}),
    bound<&OperationPlan::robot, &RobotPlan::approach, &ApproachOptions::corrections,
          &Corrections::tolerance_deg>({.name = "tolerance_deg",
                                        .label = "Tolerance of turn",
                                        .unit = "deg",
                                        .range = {0.01, 10},
                                        .help = "The same of its turn"})};

}  // namespace helicarm

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/case_registration/measure_case.h"
#include "helicarm/operation/case_of.h"
#include "helicarm/operation/tool_line.h"

/// Models of a plan, such as bones in a CT, whose plans guide the tool.
namespace helicarm::operation {

/// Copies the files of the plan's models into `session`/models, which only the owner can read; the plan's
/// models are then those copies. Returns their digests by name in that folder. Refuses cannot_write and
/// missing_file, and what a registration would not read (as `load_model`, `read_plans`).
Expected<Digests> keep_models(OperationPlan& plan, const std::filesystem::path& session);

/// Registers the models to a measured case by its calibration, some of them from other starts than the
/// plan's. Refusals are in the result. Refuses (bad_value) a start of no model.
Expected<case_registration::CaseRegistration> register_models(const OperationPlan& plan,
                                                              const pipeline::Case& the_case,
                                                              const pipeline::Result& measured,
                                                              const case_registration::Progress& progress,
                                                              const std::vector<ModelStart>& starts = {});

/// The plan's models where their search would begin, as `case_registration::models_at_starts`. Refuses
/// (usage) without a calibration.
Expected<case_registration::CaseRegistration> models_at_starts(
    const OperationPlan& plan, const pipeline::Case& the_case, const pipeline::Result& measured,
    const case_registration::Progress& progress = {});

/// registration.json without its times, which differ from run to run.
Json recorded(const case_registration::CaseRegistration& registration);

/// The measurement with the points and tunnels of the models' plans at the case's present poses, held to the
/// plan's error limit, and with the tool's lines against the models' tunnels.
Expected<pipeline::Result> with_registration(const pipeline::Result& measured,
                                             const case_registration::CaseRegistration& registration,
                                             const OperationPlan& plan, const pipeline::Case& the_case,
                                             const std::vector<guidance::ToolLine>& lines = {});

/// Refuses (uncertain) a tunnel whose end has a 95 % error over the plan's limit at the tool's tip, with the
/// errors of registration, calibration, tracker and of the tool's own calibration; not_seen, no_pose.
Expected<void> check_error_at_tip(const OperationPlan& plan, const OperationTunnel& tunnel,
                                  const pipeline::Result& result, const guidance::Poses& now,
                                  const TrackedTool& tool);

}  // namespace helicarm::operation

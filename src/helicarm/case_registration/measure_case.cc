// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/measure_case.h"

#include "helicarm/case_registration/carry_plan.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/report/earlier_results.h"

namespace helicarm::case_registration {
namespace {

void append(std::vector<pipeline::Finding>& findings, const std::vector<Warning>& more) {
  for (const Warning& warning : more) findings.push_back({warning, pipeline::Stage::registration});
}

/// The plan of a model, its tunnels' ends counted among all models' points.
void add_plan(const RegisteredModel& model, pipeline::Result& result) {
  const std::size_t first = result.model_points.size();
  const std::string& name = model.registration.name;
  for (const RegisteredPoint& point : model.points)
    result.model_points.push_back({name, point.name, point.place});
  for (std::size_t i = 0; i < model.tunnels.size(); ++i) {
    const pipeline::TunnelEnds& ends = model.tunnel_ends[i];
    result.model_tunnels.push_back({name,
                                    model.tunnels[i],
                                    {first + ends.start, first + ends.end},
                                    shared_covariance(model.registration),
                                    i < model.bone_checks.size() ? model.bone_checks[i] : std::nullopt});
  }
}

}  // namespace

pipeline::Result with_models(pipeline::Result result, const CaseRegistration& registration) {
  for (const RegisteredModel& model : registration.models) {
    const registration::Registration& found = model.registration;
    append(result.warnings, found.warnings);
    append(result.notes, found.notes);
    // A breach is of the plan: its tunnels are shown at their places.
    if (!found.failure || found.failure->reason == Reason::tunnel_breach) add_plan(model, result);
    if (found.failure && !result.failure)
      result.failure = found.failure, result.refused_at = pipeline::Stage::registration;
  }
  return result;
}

Expected<Measurement> measure_case(const pipeline::Case& the_case, const RegisterOptions& options,
                                   const Progress& progress) {
  return guarded([&] {
    auto done = value_or_throw(pipeline::measure(the_case, options.run, progress.of_views()));
    std::vector<guidance::Poses> poses;
    for (const pipeline::CaseView& view : the_case.views) poses.push_back(view.poses);
    if (done.failure || the_case.models.empty()) return Measurement{std::move(done), {}, std::move(poses)};
    auto registration =
        value_or_throw(register_loaded(the_case, views_of_calibration(the_case, *done.calibration), options,
                                       progress, located_points_of(done)));
    pipeline::Result result = with_models(std::move(done), registration);
    return Measurement{std::move(result), std::move(registration), std::move(poses)};
  });
}

Expected<void> write_models(const std::optional<CaseRegistration>& registration,
                            const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "registration.json", details = folder / "registration";
  forget_files(folder, {file.filename().string()});
  report::forget_registration(details);
  if (!registration) return {};
  return write_registration(*registration, details).and_then([&] {
    return write_file(file, to_text(to_json(*registration)) + "\n");
  });
}

}  // namespace helicarm::case_registration

// SPDX-License-Identifier: Apache-2.0
#include "checks.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/pipeline/registration_case.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

py::object register_models(const std::filesystem::path& folder,
                           const std::optional<std::filesystem::path>& out,
                           std::optional<double> max_error_mm, double search_mm, double search_deg,
                           unsigned threads, const py::object& progress) {
  case_registration::RegisterOptions options;
  if (max_error_mm) options.max_error_mm = checked(*max_error_mm, within({1e-6, 1000}), "max_error_mm");
  options.shift_mm = checked(search_mm, within({0, 100}), "search_mm");
  options.turn_deg = checked(search_deg, within({0, 180}), "search_deg");
  options.threads = threads;
  const RunHooks hooks = run_hooks(progress);
  options.on_step = [&](const std::string& model, std::string_view step) {
    hooks.on_stage(model.empty() ? std::string(step) : model + ": " + std::string(step));
  };
  const auto result = value_or_raise(without_gil([&] {
    return pipeline::read_registration_case(folder)
        .and_then([&](const pipeline::RegistrationCase& given) {
          return case_registration::register_case(given, options);
        })
        .and_then([&](case_registration::CaseRegistration made) {
          const auto written = out ? case_registration::write_registration(made, *out) : Expected<void>{};
          return written.map([&] { return std::move(made); });
        });
  }));
  py::object answer = python_from(case_registration::to_json(result));
  if (result.failure) raise(*result.failure, answer);
  for (const case_registration::RegisteredModel& model : result.models)
    if (model.registration.failure) raise(*model.registration.failure, answer);
  return answer;
}

}  // namespace

void add_registration(py::module_& module) {
  const case_registration::RegisterOptions defaults;
  module.def(
      "register", &register_models, py::arg("folder"), py::kw_only(), py::arg("out") = py::none(),
      py::arg("max_error_mm") = py::none(), py::arg("search_mm") = defaults.shift_mm,
      py::arg("search_deg") = defaults.turn_deg, py::arg("threads") = defaults.threads,
      py::arg("progress") = py::none(),
      "Register the CT volumes and surfaces of a case (\"models\" of its case.json) to its views, as\n"
      "`helicarm register` does.\n\n"
      "Returns the content of registration.json: for each model world_from_model (4 x 4, mm), covariance\n"
      "(6 x 6: rotation vector, rad, then translation, mm, world axes, about centre_mm), decision, "
      "warnings,\n"
      "points and tunnels of its plan. World: the calibrator's frame, or that of the views' cameras.\n\n"
      "out: folder for registration.json, report.html and overlays, or None. max_error_mm: refuse where a\n"
      "point of the model may be off by more (95 %). search_mm, search_deg: searched about each start, per\n"
      "axis. threads: 0 for all cores. progress: called with the name of each step.\n\n"
      "Raises as run_case; RefusedError if the views or a model are refused, with all that was computed in\n"
      ".result.");
}

}  // namespace helicarm::python

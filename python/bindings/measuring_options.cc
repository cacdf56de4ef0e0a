// SPDX-License-Identifier: Apache-2.0
#include "measuring_options.h"

#include "checks.h"
#include "helicarm/pipeline/run_fields.h"
#include "options.h"

namespace helicarm::python {

case_registration::RegisterOptions measuring_options(const char* function, const std::string& method,
                                                     std::optional<double> max_error_mm,
                                                     double motion_sigma_mm, double search_mm,
                                                     double search_deg, unsigned threads,
                                                     const std::optional<std::filesystem::path>& history) {
  case_registration::RegisterOptions options;
  options.run.method = method_of(method);
  for (const auto& field : pipeline::run_fields) {
    const auto given = field.name == "max_error_mm"      ? max_error_mm
                       : field.name == "motion_sigma_mm" ? std::optional(motion_sigma_mm)
                                                         : std::nullopt;
    if (given) field.set(options.run, checked(*given, within(field.range), std::string(field.name)));
  }
  options.run.threads = threads;
  value_or_raise(check_fields<pipeline::RunOptions>(pipeline::run_fields, options.run, function));
  options.shift_mm = checked(search_mm, within({0, 100}), "search_mm");
  options.turn_deg = checked(search_deg, within({0, 180}), "search_deg");
  if (history) options.run.history = value_or_raise(calibration::history_at(*history));
  return options;
}

void listen(const RunHooks& hooks, case_registration::RegisterOptions& options) {
  options.run.on_view = hooks.on_view;
  options.interrupt = hooks.on_view;
  options.on_step = [&hooks](const std::string& model, std::string_view step) {
    hooks.on_stage(model.empty() ? std::string(step) : model + ": " + std::string(step));
  };
}

}  // namespace helicarm::python

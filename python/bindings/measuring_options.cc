// SPDX-License-Identifier: Apache-2.0
#include "measuring_options.h"

#include "checks.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/pipeline/map_cache.h"
#include "helicarm/pipeline/run_fields.h"
#include "options.h"

namespace helicarm::python {

case_registration::RegisterOptions measuring_options(const char* function, const std::string& method,
                                                     std::optional<double> max_error_mm,
                                                     double motion_sigma_mm, double search_mm,
                                                     double search_deg, unsigned threads,
                                                     const std::optional<std::filesystem::path>& history,
                                                     const py::object& cache, bool extends_history) {
  case_registration::RegisterOptions options;
  options.run.method = method_of(method);
  for (const auto& field : pipeline::run_fields) {
    const auto number = field.name == "max_error_mm"      ? max_error_mm
                        : field.name == "motion_sigma_mm" ? std::optional(motion_sigma_mm)
                                                          : std::nullopt;
    if (number) field.set(options.run, checked(*number, within(field.range), std::string(field.name)));
  }
  options.run.threads = threads;
  value_or_raise(check_fields<pipeline::RunOptions>(pipeline::run_fields, options.run, function));
  for (const auto& field : case_registration::search_fields)
    field.set(options.search, checked(field.name == "search_mm" ? search_mm : search_deg, within(field.range),
                                      std::string(field.name)));
  if (py::isinstance<py::bool_>(cache))
    options.run.cache = cache.cast<bool>() ? pipeline::user_cache_folder() : std::nullopt;
  else
    options.run.cache = cache.cast<std::filesystem::path>();
  if (history)
    options.run.history = value_or_raise(extends_history ? calibration::history_at(*history)
                                                         : calibration::read_history(*history));
  return options;
}

case_registration::Progress progress_of(const RunHooks& hooks) {
  return {[&hooks](const std::string& model, std::string_view step) {
            hooks.on_stage(case_registration::words_of_step(model, step));
          },
          hooks.on_view, hooks.on_share};
}

}  // namespace helicarm::python

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/c_arm.h"

#include "helicarm/core/files.h"
#include "helicarm/report/c_arm_report.h"
#include "module.h"
#include "options.h"

namespace helicarm::python {
namespace {

py::object check_c_arm(const std::filesystem::path& record, const std::filesystem::path& folder,
                       unsigned threads) {
  const auto check = value_or_raise(without_gil([&] {
    return guarded([&] {
      auto acquired = value_or_throw(pipeline::c_arm_acquisitions(folder, threads)).entries;
      return value_or_throw(pipeline::check_against_record(
          std::move(acquired), value_or_throw(calibration::read_history(record)), record.string()));
    });
  }));
  const py::object answer = python_from(report::to_json(check));
  if (const auto change = pipeline::c_arm_change(check)) raise(*change, answer);
  return answer;
}

std::size_t add_to_c_arm(const std::filesystem::path& record, const std::filesystem::path& folder,
                         const std::optional<std::string>& date, unsigned threads) {
  return value_or_raise(without_gil([&] {
    return guarded([&] {
      if (date) value_or_throw(calibration::check_acquisition_day(*date));
      value_or_throw(calibration::check_history_file(record));
      const auto acquired = value_or_throw(pipeline::c_arm_acquisitions(folder, threads));
      return value_or_throw(pipeline::add_to_record(record, acquired, date)).added;
    });
  }));
}

py::object c_arm_report(const std::filesystem::path& record,
                        const std::optional<std::filesystem::path>& out) {
  const report::CArmFindings findings = value_or_raise(without_gil([&] {
    return guarded([&] {
      if (out) value_or_throw(check_can_write(*out));
      if (out) report::forget_c_arm_report(*out);
      auto found = report::c_arm_findings(value_or_throw(
          pipeline::model_of_record(value_or_throw(calibration::read_history(record)), record.string())));
      if (out) value_or_throw(report::write_c_arm_report(found, *out));
      return found;
    });
  }));
  return python_from(report::to_json(findings));
}

}  // namespace

void add_c_arm(py::module_& module) {
  module.def(
      "check_c_arm", &check_c_arm, py::arg("record"), py::arg("folder"), py::kw_only(),
      py::arg("threads") = 0u,
      R"(Compares a case with what a C-arm's record predicts for its positions, as `helicarm c-arm check` does.

record: the file of run_case's history. folder: holds case.json; or a result.json or sweep.json. Returns chi2 of all acquisitions, its 99.9 % limit, and for
each acquisition estimate_mm, predicted_mm, sigma_mm (source distance, principal point) and chi2. Raises InputError;
RefusedError, with c_arm_changed and the same figures in .result where the C-arm has changed.)");
  module.def(
      "add_to_c_arm", &add_to_c_arm, py::arg("record"), py::arg("folder"), py::kw_only(),
      py::arg("date") = py::none(), py::arg("threads") = 0u,
      R"(Adds the acquisitions of a case to a C-arm's record, each once, as `helicarm c-arm add` does; returns how many.

record: a file, made where there is none. folder: holds case.json; or a result.json or sweep.json. date: of the
acquisitions, like 2026-11-26 (default: today). Raises InputError; RefusedError, with c_arm_changed where they lie beyond what the record predicts: nothing is added.)");
  module.def(
      "c_arm_report", &c_arm_report, py::arg("record"), py::kw_only(), py::arg("out") = py::none(),
      R"(Sag and repeatability of a C-arm by its record, and each acquisition beside the prediction by all others.

out: a folder for report.html, report.pdf, c_arm.csv and c_arm.svg. Returns focal_mm and principal_mm with the standard deviations
smooth (over the positions) and repeat (in one position), and acquisitions. Raises InputError, RefusedError.)");
}

}  // namespace helicarm::python

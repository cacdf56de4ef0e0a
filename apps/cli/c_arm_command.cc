// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "command_line.h"
#include "findings.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/c_arm.h"
#include "helicarm/report/c_arm_report.h"

namespace helicarm::cli {
namespace {

struct CArmAddArguments {
  std::filesystem::path record;
  std::vector<std::filesystem::path> cases;
  std::optional<std::string> date;
};

struct CArmReportArguments {
  std::filesystem::path record;
  std::filesystem::path out = "c-arm-report";
};

struct CArmCheckArguments {
  std::filesystem::path record;
  std::filesystem::path folder;
};

pipeline::CArmAcquisitions acquisitions_of(const std::filesystem::path& from, Console& console) {
  auto measured = value_or_throw(pipeline::c_arm_acquisitions(from, console.threads));
  print_warnings(measured.warnings, console);
  return measured;
}

CommandResult c_arm_add_command(const CArmAddArguments& arguments, Console& console) {
  return guarded([&] {
    if (arguments.date) value_or_throw(calibration::check_acquisition_day(*arguments.date));
    value_or_throw(calibration::check_history_file(arguments.record));
    for (const std::filesystem::path& folder : arguments.cases)  // before anything is added
      if (!std::filesystem::exists(folder))
        throw BadInput(Reason::missing_file, fmt::format("{}: no such file or folder", folder.string()));
    Json added = Json::array();
    for (const std::filesystem::path& folder : arguments.cases) {
      const auto growth =
          value_or_throw(guarded([&] {
                           return value_or_throw(pipeline::add_to_record(
                               arguments.record, acquisitions_of(folder, console), arguments.date));
                         }).map_error([&](Failure failure) {
            failure.message = fmt::format("{}: {}", folder.string(), failure.message);
            return failure;
          }));
      added.push_back({{"case", folder.string()}, {"earlier", growth.earlier}, {"added", growth.added}});
      if (!console.json)
        console.out << fmt::format("{}: {} acquisitions added to {}\n", folder.string(), growth.added,
                                   growth.earlier);
    }
    if (console.json) console.out << to_text(Json{{"added", std::move(added)}}) << '\n';
  });
}

CommandResult c_arm_report_command(const CArmReportArguments& arguments, Console& console) {
  return guarded([&] {
    value_or_throw(check_can_write(arguments.out));
    report::forget_c_arm_report(arguments.out);
    const report::CArmFindings findings = report::c_arm_findings(value_or_throw(pipeline::model_of_record(
        value_or_throw(calibration::read_history(arguments.record)), arguments.record.string())));
    value_or_throw(report::write_c_arm_report(findings, arguments.out));
    if (console.json)
      console.out << to_text(report::to_json(findings)) << '\n';
    else
      console.out << report::c_arm_text(findings) << fmt::format("  written to {}\n", arguments.out.string());
  });
}

CommandResult c_arm_check_command(const CArmCheckArguments& arguments, Console& console) {
  return guarded([&] {
    const calibration::CArmHistory record = value_or_throw(calibration::read_history(arguments.record));
    const calibration::CArmCheck check = value_or_throw(pipeline::check_against_record(
        acquisitions_of(arguments.folder, console).entries, record, arguments.record.string()));
    const std::optional<Failure> change = pipeline::c_arm_change(check);
    print_warnings(pipeline::limits_of(check), console);
    if (console.json) {
      Json answer = report::to_json(check);
      answer["status"] = change ? "refused" : "ok";
      answer["failure"] = change ? pipeline::to_json(*change) : Json();
      console.out << to_text(answer) << '\n';
      console.answered = true;
    } else {
      console.out << report::text_of(report::c_arm_table(check.acquisitions));
      for (const calibration::MapDifference& map : check.maps)
        console.out << fmt::format("  {}: distortion {:.2f} px rms from the prediction, sigma {:.2f}\n",
                                   map.view, map.error_px, map.sigma_px);
    }
    if (change) throw BadInput(*change);
    if (!console.json)
      console.out << fmt::format("\n  unchanged: chi-square {:.1f}, limit {:.1f}\n", check.chi2, check.limit);
  });
}

}  // namespace

void add_c_arm(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::images, "c-arm", "Record a C-arm over cases, report it, and see a change of it",
                  "helicarm c-arm add arm-2.json monday tuesday/result.json run/sweep.json\n"
                  "  helicarm c-arm report arm-2.json --out arm-2\n"
                  "  helicarm c-arm check arm-2.json wednesday\n\n"
                  "The record is the file of `run --machine`: source distance and principal point of each "
                  "acquisition with their\n"
                  "covariance, positioner angles and date,\nand the distortion map of each image with a "
                  "plate; results of `run` and `sweep` hold them too. A "
                  "check ends with exit code 3 and c_arm_changed "
                  "where a case lies beyond\n"
                  "what the record predicts for its positions (99.9 %) and beyond the record's "
                  "\"tolerances\"; `add` refuses\nsuch a case: after a service begin a new record.");
  command->require_subcommand(1);
  auto* add =
      command->add_subcommand("add", "Add the acquisitions of cases, results and runs of images, each once");
  auto& added = arguments_of(add, action, c_arm_add_command);
  add->add_option("RECORD", added.record, "The record (JSON); made where there is none")->required();
  add->add_option("CASE", added.cases,
                  "Folders that hold case.json (measured now), or results: result.json, sweep.json")
      ->required();

  add->add_option(
      "--date", added.date,
      "Day on which they were acquired, like 2026-11-26 (default: today; images' dates are not read, "
      "as a record names no patient's)");

  auto* report = command->add_subcommand(
      "report", "Sag, repeatability and every acquisition, as a page, a PDF to sign and a table");
  auto& reported = arguments_of(report, action, c_arm_report_command);
  report->add_option("RECORD", reported.record, "The record (JSON)")->required();
  report->add_option("--out", reported.out, "Folder for report.html, report.pdf, c_arm.csv and c_arm.svg")
      ->capture_default_str();

  auto* check = command->add_subcommand("check", "Compare a new case with what the record predicts");
  auto& checked = arguments_of(check, action, c_arm_check_command);
  check->add_option("RECORD", checked.record, "The record (JSON), read only")->required();
  check
      ->add_option("CASE", checked.folder,
                   "Folder that holds case.json, or a result: result.json, sweep.json")
      ->required();
}

}  // namespace helicarm::cli

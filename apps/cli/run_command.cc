// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "command_line.h"
#include "distinct_names.h"
#include "helicarm/case_registration/register_fields.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/pipeline/run_fields.h"
#include "helicarm/report/earlier_results.h"
#include "shared_work.h"

namespace helicarm::cli {
namespace {

namespace fs = std::filesystem;

/// A line of summary.csv.
struct CaseSummary {
  std::string name;
  std::optional<Failure> failure;
  std::size_t points = 0, located = 0, warnings = 0;
  std::optional<double> worst_error_mm, fre_mm, tre_mm;
};

CaseSummary summary_of(const std::string& name, const Expected<case_registration::Measurement>& measured) {
  CaseSummary summary;
  summary.name = name;
  const pipeline::Result* result = measured ? &measured->result : nullptr;
  summary.failure = result ? result->failure : measured.error();
  if (summary.failure && !summary.failure->view.empty())
    summary.failure->message = summary.failure->view + ": " + summary.failure->message;
  if (!result) return summary;
  summary.warnings = result->warnings.size();
  summary.points = result->points.size();
  for (const pipeline::PointResult& point : result->points)
    if (point.place) {
      ++summary.located;
      summary.worst_error_mm = std::max(summary.worst_error_mm.value_or(0),
                                        localization::length_at_95(point.place->covariance_in_calibrator));
    }
  if (result->accuracy.fre_mm.n > 0) summary.fre_mm = result->accuracy.fre_mm.mean;
  if (result->accuracy.tre_mm.n > 0) summary.tre_mm = result->accuracy.tre_mm.mean;
  return summary;
}

std::string_view status_of(const CaseSummary& summary) {
  if (!summary.failure) return "ok";
  return exit_code(summary.failure->reason) == 2 ? "failed" : "refused";
}

std::string csv_of(const std::vector<CaseSummary>& cases) {
  const auto number = [](const std::optional<double>& value) {
    return value ? fmt::format("{:.4f}", *value) : std::string();
  };
  std::string csv =
      "case,status,code,message,points,located,worst_error_95_mm,fre_mean_mm,tre_mean_mm,warnings\n";
  for (const CaseSummary& c : cases)
    csv += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", csv_field(c.name), status_of(c),
                       c.failure ? code(c.failure->reason) : "",
                       c.failure ? csv_field(c.failure->message) : "", c.points, c.located,
                       number(c.worst_error_mm), number(c.fre_mm), number(c.tre_mm), c.warnings);
  return csv;
}

/// What went wrong with the cases, by the gravest of them.
Failure gravest(const std::vector<CaseSummary>& cases, const fs::path& csv) {
  std::size_t failed = 0;
  const CaseSummary* worst = nullptr;
  for (const CaseSummary& c : cases) {
    if (!c.failure) continue;
    ++failed;
    if (!worst || exit_code(c.failure->reason) < exit_code(worst->failure->reason)) worst = &c;
  }
  Failure failure = *worst->failure;
  failure.view.clear();
  failure.message = fmt::format("{} of {} cases give no result, {} for example: {} ({} lists all)", failed,
                                cases.size(), worst->name, failure.message, csv.string());
  failure.figures = {{"cases", double(cases.size())}, {"without_result", double(failed)}};
  return failure;
}

/// Results of an earlier run of several cases in this folder, by its summary.
void forget_earlier(const fs::path& out) {
  std::error_code ignored;
  const auto summary = read_csv(out / "summary.csv", {"case"},
                                {"status", "code", "message", "points", "located", "worst_error_95_mm",
                                 "fre_mean_mm", "tre_mean_mm", "warnings"});
  if (summary)
    for (std::size_t row = 0; row < summary->rows(); ++row) {
      const fs::path name = summary->text(row, "case");
      if (name.empty() || name != name.filename() || name == "." || name == "..") continue;
      report::forget_results(out / name);
      if (fs::is_directory(out / name, ignored) && fs::is_empty(out / name, ignored))
        fs::remove(out / name, ignored);
    }
  forget_files(out, {"summary.csv"});
}

Json json_of(const CaseSummary& summary) {
  const auto number = [](const std::optional<double>& value) { return value ? Json(*value) : Json(); };
  Json json{{"name", summary.name},
            {"points", summary.points},
            {"located", summary.located},
            {"warnings", summary.warnings},
            {"worst_error_mm", number(summary.worst_error_mm)},
            {"fre_mm", number(summary.fre_mm)},
            {"tre_mm", number(summary.tre_mm)}};
  if (summary.failure)
    json["failure"] = {{"code", code(summary.failure->reason)}, {"message", summary.failure->message}};
  return json;
}

CaseSummary summary_from(const Json& json) {
  const auto number = [&](const char* key) {
    return json.at(key).is_null() ? std::nullopt : std::optional(json.at(key).get<double>());
  };
  CaseSummary summary{json.at("name").get<std::string>(),
                      std::nullopt,
                      json.at("points").get<std::size_t>(),
                      json.at("located").get<std::size_t>(),
                      json.at("warnings").get<std::size_t>(),
                      number("worst_error_mm"),
                      number("fre_mm"),
                      number("tre_mm")};
  if (json.contains("failure"))
    for (const Reason reason : all_reasons())
      if (code(reason) == json["failure"].at("code").get<std::string>())
        summary.failure = Failure{reason, json["failure"].at("message").get<std::string>(), {}, {}};
  return summary;
}

CaseSummary measure_one(const RunCasesArguments& arguments, std::size_t index, const std::string& name,
                        const Console& console) {
  RunArguments run = arguments.run;
  run.folder = arguments.cases[index];
  run.out = arguments.run.out / name;
  Console silent = console;
  silent.quiet = true;
  return summary_of(name, run_and_write(run, silent));
}

std::string line_of(const CaseSummary& c) {
  if (c.failure) return fmt::format("{}: {}: {}", c.name, code(c.failure->reason), c.failure->message);
  if (c.points == 0) return fmt::format("{}: calibrated, no points, {} warnings", c.name, c.warnings);
  return fmt::format("{}: {} of {} points, 95 % error up to {:.3f} mm, {} warnings", c.name, c.located,
                     c.points, c.worst_error_mm.value_or(0), c.warnings);
}

CommandResult all_done(const std::vector<CaseSummary>& done, const fs::path& csv, Console& console) {
  if (std::ranges::any_of(done, [](const CaseSummary& c) { return c.failure.has_value(); }))
    return tl::unexpected<Failure>(gravest(done, csv));
  if (console.json)
    console.out << to_text(Json{{"cases", done.size()}, {"summary", csv.string()}}) << '\n';
  else if (!console.quiet)
    console.out << fmt::format("\n  {} cases, written to {}\n", done.size(), csv.string());
  return {};
}

CommandResult run_several(const RunCasesArguments& arguments, Console& console) {
  const std::vector<std::string> names = names_of(arguments.cases);
  const fs::path csv = arguments.run.out / "summary.csv";
  std::vector<CaseSummary> done;
  forget_earlier(arguments.run.out);
  for (std::size_t i = 0; i < names.size(); ++i) {
    done.push_back(measure_one(arguments, i, names[i], console));
    if (auto written = write_file(csv, csv_of(done)); !written) return written;
    if (!console.quiet)
      console.progress << fmt::format("[{}/{}] {}\n", i + 1, names.size(), line_of(done.back()));
  }
  return all_done(done, csv, console);
}

/// As `run_several`, with other processes. The one that ends it reports; the others succeed.
CommandResult run_shared(const RunCasesArguments& arguments, const Launch& launch, Console& console) {
  const std::vector<std::string> names = names_of(arguments.cases);
  const fs::path csv = arguments.run.out / "summary.csv";
  return guarded([&] {
    SharedWork work(arguments.run.out, launch, names, [&] { forget_earlier(arguments.run.out); });
    const auto given_up = [&](std::size_t index) {
      CaseSummary summary;
      summary.name = names[index];
      summary.failure =
          Failure{Reason::interrupted, "each process that measured it ended before it was done", {}, {}};
      return json_of(summary);
    };
    while (const auto item = work.next(given_up)) {
      const CaseSummary summary = measure_one(arguments, item->index, names[item->index], console);
      work.done(*item, json_of(summary));
      if (!console.quiet)
        console.progress << fmt::format("[{} of {}{}] {}\n", item->index + 1, names.size(),
                                        item->taken_over ? ", whose first process ended" : "",
                                        line_of(summary))
                         << std::flush;
    }
    std::vector<CaseSummary> all;
    const bool reports = work.finish([&](const std::vector<Json>& rows) {
      for (const Json& row : rows) all.push_back(summary_from(row));
      value_or_throw(write_file(csv, csv_of(all)));
    });
    if (reports) value_or_throw(all_done(all, csv, console));
  });
}

}  // namespace

std::vector<std::string> names_of(const std::vector<fs::path>& cases) {
  std::vector<std::string> names;
  for (const fs::path& case_folder : cases) {
    const fs::path whole = fs::absolute(case_folder).lexically_normal();
    const bool is_folder = whole.has_filename() && whole.extension() != ".json";
    const std::string name = (is_folder ? whole : whole.parent_path()).filename().string();
    names.push_back(name.empty() ? "case" : name);
  }
  return distinct(names);
}

CommandResult run_command(const RunCasesArguments& arguments, Console& console) {
  if (arguments.cases.size() > 1) {
    auto launch = launch_of_environment();
    if (!arguments.share.empty()) launch = Launch{arguments.share, launch ? launch->processes : 0};
    return launch ? run_shared(arguments, *launch, console) : run_several(arguments, console);
  }
  RunArguments run = arguments.run;
  run.folder = arguments.cases.front();
  return run_one_case(run, console);
}

void add_run(CLI::App& app, Action& action) {
  auto* command = add_command(
      app, group::measure, "run",
      "Measure a case: cameras with covariances from X-ray images, and from two or more points and tunnels",
      "helicarm run my-case --out my-result\n"
      "  helicarm run study/* --out results    each case in results/NAME, all in results/summary.csv\n"
      "  mpirun -n 8 helicarm run study/* --out results    the same by eight processes");
  auto& [cases, a, share] = arguments_of(command, action, run_command);
  command->add_option("CASE", cases, "Folder that holds case.json; several are run one after the other")
      ->required();
  command->add_option(
      "--share", share,
      "A word that several processes have in common, which measure the cases together, each the next "
      "that no other has; mpirun and srun need none. The same word goes on after an interruption");
  command
      ->add_option("--out", a.out,
                   "Folder for result.json, report.html and the overlays; with several cases for a folder of "
                   "each and summary.csv")
      ->capture_default_str();
  a.extends_history = true;
  add_run_options(command, a,
                  "The C-arm's history (JSON): used as prior; this case's acquisitions are added");
  add_fields(command, a.options.search, case_registration::search_fields);
  add_dicom_option(command, a);
  command->add_flag("--no-report", a.no_report, "Write result.json only");
}

}  // namespace helicarm::cli

// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/core/earlier_files.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/advice.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_case.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/report.h"
#include "helicarm/report/tables.h"

namespace helicarm::cli {
namespace {

/// Each kind once, with the number of further points.
void print_notes(const std::vector<Warning>& notes, std::ostream& out) {
  std::map<Reason, std::size_t> more;
  for (const Warning& note : notes) ++more[note.reason];
  for (const Warning& note : notes)
    if (const auto of_kind = more.extract(note.reason))
      out << fmt::format("helicarm: note: {}: {}{}\n", code(note.reason), note.message,
                         of_kind.mapped() > 1 ? fmt::format(" (and {} more)", of_kind.mapped() - 1) : "");
}

/// Likely causes of a refusal, and where to look.
void print_advice(const pipeline::Result& result, const RunArguments& arguments, std::ostream& out) {
  const pipeline::Advice advice = pipeline::advice_for(result);
  if (advice.causes.empty()) return;
  out << "helicarm: likely causes, in order:\n";
  for (std::size_t i = 0; i < advice.causes.size(); ++i)
    out << fmt::format("  {}. {}\n", i + 1, advice.causes[i]);
  out << fmt::format("  Next: {}\n", advice.next);
  if (!arguments.no_report)
    out << fmt::format("  All that was found: {}\n", (arguments.out / "report.html").string());
}

/// Adds each image once; nothing if the residuals are inconsistent with the noise model.
Expected<void> add_to_c_arm_history(const std::filesystem::path& path, const pipeline::Result& result,
                                    Console& console) {
  const auto growth = calibration::add_to_history(path, result.entries);
  if (!growth) return tl::unexpected<Failure>(growth.error());
  if (!console.quiet)
    console.progress << (result.variance_scale > 1
                             ? fmt::format(
                                   "helicarm: {}: not added to the C-arm history: residuals are {:.2g} times "
                                   "the noise model\n",
                                   path.string(), std::sqrt(result.variance_scale))
                             : fmt::format("helicarm: {}: {} earlier acquisitions, {} added\n", path.string(),
                                           growth->earlier, growth->added));
  return {};
}

/// result.json is written last, so that its presence implies the other files.
Expected<void> write(const pipeline::Result& result, const RunArguments& arguments) {
  auto written = arguments.no_report ? Expected<void>() : report::write_report(result, arguments.out);
  if (written) written = write_file(arguments.out / "result.json", to_text(pipeline::to_json(result)) + "\n");
  if (written) return written;
  std::vector<std::string> overlays;
  for (std::size_t i = 0; i < result.views.size(); ++i)
    overlays.push_back(report::overlay_name(result.views[i].name, i));
  forget_files(arguments.out, overlays);
  report::forget_results(arguments.out);
  return written;
}

/// A case whose description excludes an answer (a flat calibrator, for example) is refused like any other.
Expected<pipeline::Result> result_of(const std::filesystem::path& folder,
                                     const pipeline::RunOptions& options) {
  const auto given = pipeline::read_case(folder);
  if (given) return pipeline::run_case(*given, options);
  if (exit_code(given.error().reason) == 2) return tl::unexpected<Failure>(given.error());
  pipeline::Result refused;
  refused.options = options;
  refused.failure = given.error();
  return refused;
}

}  // namespace

Expected<std::optional<calibration::CArmHistory>> history_at(
    const std::optional<std::filesystem::path>& path) {
  if (!path) return std::optional<calibration::CArmHistory>();
  return calibration::history_at(*path).map(
      [](calibration::CArmHistory history) { return std::optional(std::move(history)); });
}

Expected<rectification::Method> method_named(const std::string& name) {
  if (name == "best") return rectification::Method::best;
  if (name == "paper") return rectification::Method::paper;
  return fail(Reason::usage, fmt::format("--method: \"{}\" is none of: best, paper", name));
}

std::string summary_of(const pipeline::Result& result) {
  std::string text;
  for (const report::Table& table : {report::statistics_table(result.accuracy),
                                     report::points_table(result.points), report::tunnels_table(result),
                                     report::verification_table(report::tools_at_ends(result.verifications))})
    if (!table.rows.empty())
      text += fmt::format("{}{}\n{}", text.empty() ? "" : "\n", table.heading,
                          report::text_of(report::without_empty_columns(table)));
  return text;
}

Expected<pipeline::Result> measure(const RunArguments& arguments, Console& console) {
  return guarded([&] {
    pipeline::RunOptions options = arguments.options;
    options.threads = console.threads;
    options.history = value_or_throw(history_at(arguments.history));
    pipeline::Result result = value_or_throw(result_of(arguments.folder, options));
    if (!console.quiet) {
      for (const Warning& warning : result.warnings)
        console.progress << fmt::format("helicarm: warning: {}: {}{}{}\n", code(warning.reason), warning.view,
                                        warning.view.empty() ? "" : ": ", warning.message);
      print_notes(result.notes, console.progress);
    }
    return result;
  });
}

Expected<pipeline::Result> run_and_write(const RunArguments& arguments, Console& console) {
  return guarded([&] {
    report::forget_results(arguments.out);
    if (arguments.history) value_or_throw(calibration::check_history_file(*arguments.history));
    const pipeline::Result result = value_or_throw(measure(arguments, console));
    value_or_throw(write(result, arguments));
    if (arguments.history && !result.failure)
      value_or_throw(add_to_c_arm_history(*arguments.history, result, console));
    return result;
  });
}

CommandResult run_command(const RunArguments& arguments, Console& console) {
  const auto result = run_and_write(arguments, console);
  if (!result) return tl::unexpected<Failure>(result.error());
  if (result->failure && !console.quiet) print_advice(*result, arguments, console.progress);
  if (result->failure) return tl::unexpected<Failure>(*result->failure);
  if (console.json)
    console.out << to_text(pipeline::to_json(*result)) << '\n';
  else if (!console.quiet)
    console.out << summary_of(*result) << fmt::format("\n  written to {}\n", arguments.out.string());
  return {};
}

}  // namespace helicarm::cli

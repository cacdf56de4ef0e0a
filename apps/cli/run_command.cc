// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/advice.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/run_case.h"
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

/// The views of an earlier result in the folder, if any.
std::vector<std::string> earlier_views(const std::filesystem::path& out) {
  std::vector<std::string> names;
  const auto json = read_json(out / "result.json");
  if (!json || !json->is_object() || !json->contains("views") || !(*json)["views"].is_array()) return names;
  for (const Json& view : (*json)["views"])
    if (view.is_object() && view.contains("name") && view["name"].is_string())
      names.push_back(view["name"].get<std::string>());
  return names;
}

/// Removes files of an earlier or incomplete run, which could be taken for an answer.
void forget(const std::filesystem::path& out, const std::vector<std::string>& views) {
  std::error_code ignored;
  for (const char* file : {"result.json", "report.html"}) std::filesystem::remove(out / file, ignored);
  for (std::size_t i = 0; i < views.size(); ++i)
    std::filesystem::remove(out / report::overlay_name(views[i], i), ignored);
}

/// Adds each image once; nothing if the residuals are inconsistent with the noise model.
Expected<void> add_to_c_arm_history(const std::filesystem::path& path, calibration::CArmHistory history,
                                    const pipeline::Result& result, Console& console) {
  const std::size_t earlier = history.entries.size();
  const std::size_t added = calibration::add_entries(history, result.entries);
  if (!console.quiet)
    console.progress << (result.variance_scale > 1
                             ? fmt::format(
                                   "helicarm: {}: not added to the C-arm history: residuals are {:.2g} times "
                                   "the noise model\n",
                                   path.string(), std::sqrt(result.variance_scale))
                             : fmt::format("helicarm: {}: {} earlier acquisitions, {} added\n", path.string(),
                                           earlier, added));
  return write_file(path, to_text(calibration::to_json(history)) + "\n");
}

/// result.json is written last, so that its presence implies the other files.
Expected<void> write(const pipeline::Result& result, const RunArguments& arguments) {
  auto written = arguments.no_report ? Expected<void>() : report::write_report(result, arguments.out);
  if (written) written = write_file(arguments.out / "result.json", to_text(pipeline::to_json(result)) + "\n");
  if (written) return written;
  std::vector<std::string> views;
  for (const pipeline::ViewResult& view : result.views) views.push_back(view.name);
  forget(arguments.out, views);
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
    forget(arguments.out, earlier_views(arguments.out));
    const pipeline::Result result = value_or_throw(measure(arguments, console));
    value_or_throw(write(result, arguments));
    if (arguments.history && !result.failure)
      value_or_throw(add_to_c_arm_history(*arguments.history, *result.options.history, result, console));
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

// SPDX-License-Identifier: Apache-2.0
#include "run_command.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/advice.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/outcome.h"
#include "helicarm/pipeline/run_case.h"
#include "helicarm/report/overlay.h"
#include "helicarm/report/report.h"

namespace helicarm::cli {
namespace {

std::string coordinates(const Eigen::Vector3d& p) {
  return fmt::format("{:9.3f} {:9.3f} {:9.3f}", p.x(), p.y(), p.z());
}

std::string statistics_line(std::string_view what, const localization::Statistics& s) {
  if (s.n == 0) return {};
  return fmt::format("  {:<8} mean {:7.3f}   rms {:7.3f}   max {:7.3f}   n {}\n", what, s.mean, s.rms, s.max,
                     s.n);
}

/// The codes of a point's warnings, for the end of its line.
std::string marks_of(const pipeline::PointResult& point) {
  std::string marks;
  for (const Warning& warning : point.warnings) marks += fmt::format("   {}", code(warning.reason));
  return marks;
}

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

/// "   within 0.812 (95 %)" of a tunnel's end.
std::string within_in_tool(const pipeline::Result& result, const std::string& tunnel, bool start) {
  const auto error = pipeline::tunnel_end_error_in_tool(result, tunnel, start);
  return error ? fmt::format("   within {:.3f} (95 %)", *error) : "";
}

std::string summary_of(const pipeline::Result& result) {
  std::string text = statistics_line("FLE px", result.accuracy.fle_px) +
                     statistics_line("FRE mm", result.accuracy.fre_mm) +
                     statistics_line("TRE mm", result.accuracy.tre_mm);
  if (!result.points.empty())
    text += fmt::format("\n  {:<12} {:>9} {:>9} {:>9}  mm, calibrator frame\n", "point", "x", "y", "z");
  for (const pipeline::PointResult& point : result.points)
    text +=
        point.place
            ? fmt::format("  {:<12} {}   within {:.3f} (95 %){}\n", point.name,
                          coordinates(point.place->in_calibrator),
                          localization::length_at_95(point.place->covariance_in_calibrator), marks_of(point))
            : fmt::format("  {:<12} {}\n", point.name, point.reason ? code(point.reason->reason) : "");
  for (const guidance::Tunnel& tunnel : result.tunnels)
    if (tunnel.start_in_tool && tunnel.end_in_tool)
      text += fmt::format(
          "\n  tunnel {:<8} in the tool's frame, length {:.2f} mm, axis sigma {:.2f} degrees\n"
          "    start {}{}\n    end   {}{}\n",
          tunnel.name, tunnel.length_mm.value_or(0), tunnel.axis_sigma_deg().value_or(0),
          coordinates(*tunnel.start_in_tool), within_in_tool(result, tunnel.name, true),
          coordinates(*tunnel.end_in_tool), within_in_tool(result, tunnel.name, false));
  for (const verification::Verification& v : result.verifications)
    for (const auto& [end, error] : {std::pair{"start", &v.start}, {"end", &v.end}})
      if (*error)
        text += fmt::format(
            "\n  tool line {:<8} distance from the {}: {:.2f} px, {:.2f} mm (Eq. 17), {:.2f} mm in space",
            v.name, end, (*error)->combined_px, (*error)->combined_mm, (*error)->distance_mm);
  return text + (result.verifications.empty() ? "" : "\n");
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

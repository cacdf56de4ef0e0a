// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <utility>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/operation/replay.h"

namespace helicarm::cli {

struct ReplayArguments {
  std::filesystem::path session;
};

namespace {

std::string end_of(const operation::ReplayReport& report) {
  if (!report.finished) return ", operation not ended";
  return report.ended_by.empty() ? "" : ", ended by " + report.ended_by;
}

/// "to femur from 12.5 s to 40.1 s, ended by verified"
std::string words_of(const operation::GuidanceSpan& span) {
  const std::string begun =
      fmt::format("drill guided to {} from {:.1f} s", without_control_characters(span.tunnel), span.begun_s);
  return span.ended_s ? fmt::format("{} to {:.1f} s, ended by: {}", begun, *span.ended_s, span.ended_by)
                      : begun + ", its end is not recorded";
}

}  // namespace

/// Recomputes an operation from its record and reports differences.
CommandResult replay_command(const ReplayArguments& arguments, Console& console) {
  return guarded([&] {
    const operation::ReplayReport report = value_or_throw(operation::replay(arguments.session));
    if (console.json) {
      console.out << to_text(operation::to_json(report)) << '\n';
      console.answered = true;
    } else {
      console.out << fmt::format(
          "{} records{}{}: {} acquisitions, {} images of cases, {} results, {} registrations of models, {} "
          "hand-eye calibrations, {} orders, {} confirmed, {} planned again, {} outcomes, {} decisions on a "
          "hand-held drill, {} files\n",
          report.records, report.torn ? " and an incomplete one" : "", end_of(report), report.exposures,
          report.images, report.results, report.registrations, report.hand_eyes, report.orders,
          report.confirmations, report.replans, report.outcomes, report.decisions, report.files);
      for (const operation::GuidanceSpan& span : report.guidances)
        console.out << "  " << words_of(span) << '\n';
      for (const std::string& note : report.notes) console.out << "  note: " << note << '\n';
      for (const std::string& difference : report.differences) console.out << "  " << difference << '\n';
    }
    if (auto failure = operation::failure_of(report)) {
      failure->message = fmt::format("{}: {}", arguments.session.string(), failure->message);
      throw BadInput(*std::move(failure));
    }
    if (!console.json)
      console.out << (report.notes.empty() ? "all recorded values are reproduced bit for bit\n"
                                           : "all recorded values are reproduced, bit for bit but for the "
                                             "notes above\n");
  });
}

void add_replay(CLI::App& app, Action& action) {
  auto* command = add_command(app, group::operation, "replay",
                              "Recompute an operation from its record and compare bit for bit",
                              "helicarm replay operate/case-1");
  auto& a = arguments_of(command, action, replay_command);
  command->add_option("SESSION", a.session, "Folder that holds session.log")->required();
}

}  // namespace helicarm::cli

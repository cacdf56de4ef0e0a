// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

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

Json to_json(const operation::GuidanceSpan& span) {
  return {{"tunnel", span.tunnel},
          {"begun_s", span.begun_s},
          {"ended_s", span.ended_s ? Json(*span.ended_s) : Json()},
          {"ended_by", span.ended_s ? Json(span.ended_by) : Json()}};
}

}  // namespace

/// Recomputes an operation from its record and reports differences.
CommandResult replay_command(const ReplayArguments& arguments, Console& console) {
  return guarded([&] {
    const operation::ReplayReport report = value_or_throw(operation::replay(arguments.session));
    if (console.json) {
      Json guidances = Json::array();
      for (const operation::GuidanceSpan& span : report.guidances) guidances.push_back(to_json(span));
      console.out << to_text({{"records", report.records},
                              {"torn", report.torn},
                              {"finished", report.finished},
                              {"exposures", report.exposures},
                              {"pictures", report.images},
                              {"results", report.results},
                              {"hand_eyes", report.hand_eyes},
                              {"decisions", report.decisions},
                              {"guidances", guidances},
                              {"orders", report.orders},
                              {"confirmations", report.confirmations},
                              {"replans", report.replans},
                              {"outcomes", report.outcomes},
                              {"files", report.files},
                              {"ended_by", report.ended_by.empty() ? Json() : Json(report.ended_by)},
                              {"differences", report.differences}})
                  << '\n';
    } else {
      console.out << fmt::format(
          "{} records{}{}: {} acquisitions, {} images of cases, {} results, {} hand-eye calibrations, {} "
          "orders, {} confirmed, {} planned again, {} outcomes, {} decisions on a hand-held drill, {} "
          "files\n",
          report.records, report.torn ? " and an incomplete one" : "", end_of(report), report.exposures,
          report.images, report.results, report.hand_eyes, report.orders, report.confirmations,
          report.replans, report.outcomes, report.decisions, report.files);
      for (const operation::GuidanceSpan& span : report.guidances)
        console.out << "  " << words_of(span) << '\n';
      for (const std::string& difference : report.differences) console.out << "  " << difference << '\n';
    }
    if (!report.differences.empty())
      throw BadInput(Reason::replay_differs,
                     fmt::format("{} recorded values or files differ from what the record implies",
                                 report.differences.size()));
    if (!report.complete())
      throw BadInput(Reason::replay_differs,
                     fmt::format("{}: the record has no end: the program was killed or is still running, or "
                                 "records were removed",
                                 arguments.session.string()));
    if (!console.json) console.out << "all recorded values are reproduced bit for bit\n";
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

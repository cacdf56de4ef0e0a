// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/operation/replay.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::operation {

std::optional<Failure> failure_of(const ReplayReport& report) {
  if (report.complete()) return {};
  Failure failure{
      Reason::replay_differs,
      "the record has no end: the program was killed or is still running, or records were removed",
      {},
      {}};
  if (!report.differences.empty())
    failure.message = fmt::format("{} recorded values or files differ from what the record implies",
                                  report.differences.size());
  return failure;
}

Json to_json(const ReplayReport& report) {
  const std::optional<Failure> failure = failure_of(report);
  Json guidances = Json::array();
  for (const GuidanceSpan& span : report.guidances)
    guidances.push_back({{"tunnel", span.tunnel},
                         {"begun_s", span.begun_s},
                         {"ended_s", span.ended_s ? Json(*span.ended_s) : Json()},
                         {"ended_by", span.ended_s ? Json(span.ended_by) : Json()}});
  return {{"status", failure ? "refused" : "ok"},
          {"failure", failure ? pipeline::to_json(*failure) : Json()},
          {"records", report.records},
          {"torn", report.torn},
          {"finished", report.finished},
          {"ended_by", report.ended_by.empty() ? Json() : Json(report.ended_by)},
          {"complete", report.complete()},
          {"exposures", report.exposures},
          {"pictures", report.images},
          {"results", report.results},
          {"registrations", report.registrations},
          {"hand_eyes", report.hand_eyes},
          {"decisions", report.decisions},
          {"guidances", guidances},
          {"orders", report.orders},
          {"confirmations", report.confirmations},
          {"replans", report.replans},
          {"outcomes", report.outcomes},
          {"files", report.files},
          {"differences", report.differences},
          {"notes", report.notes}};
}

}  // namespace helicarm::operation

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/json.h"
#include "helicarm/operation/replay.h"

namespace helicarm::operation {

Json to_json(const ReplayReport& report) {
  Json guidances = Json::array();
  for (const GuidanceSpan& span : report.guidances)
    guidances.push_back({{"tunnel", span.tunnel},
                         {"begun_s", span.begun_s},
                         {"ended_s", span.ended_s ? Json(*span.ended_s) : Json()},
                         {"ended_by", span.ended_s ? Json(span.ended_by) : Json()}});
  return {{"records", report.records},
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

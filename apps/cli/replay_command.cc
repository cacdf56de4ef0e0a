// SPDX-License-Identifier: Apache-2.0
#include "replay_command.h"

#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/operation/replay.h"

namespace helicarm::cli {

CommandResult replay_command(const ReplayArguments& arguments, Console& console) {
  return guarded([&] {
    const operation::ReplayReport report = value_or_throw(operation::replay(arguments.session));
    if (console.json) {
      console.out << to_text({{"records", report.records},
                              {"torn", report.torn},
                              {"finished", report.finished},
                              {"exposures", report.exposures},
                              {"pictures", report.images},
                              {"results", report.results},
                              {"hand_eyes", report.hand_eyes},
                              {"decisions", report.decisions},
                              {"differences", report.differences}})
                  << '\n';
    } else {
      console.out << fmt::format(
          "{} records{}{}: {} acquisitions, {} images of cases, {} results, {} hand-eye calibrations, {} "
          "decisions on a hand-held drill\n",
          report.records, report.torn ? " and an incomplete one" : "",
          report.finished ? "" : ", operation not ended", report.exposures, report.images, report.results,
          report.hand_eyes, report.decisions);
      for (const std::string& difference : report.differences) console.out << "  " << difference << '\n';
    }
    if (!report.differences.empty())
      throw BadInput(Reason::replay_differs,
                     fmt::format("{} recorded values differ on recomputation", report.differences.size()));
    if (!console.json) console.out << "all recorded values are reproduced bit for bit\n";
  });
}

}  // namespace helicarm::cli

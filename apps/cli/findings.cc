// SPDX-License-Identifier: Apache-2.0
#include "findings.h"

#include <fmt/format.h>

namespace helicarm::cli {

void print_finding(std::string_view kind, const Failure& finding, Console& console, std::size_t more) {
  if (console.quiet) return;
  const bool named = finding.view.empty() || finding.message.starts_with(finding.view);
  console.progress << fmt::format("helicarm: {}: {}: {}{}{}{}\n", kind, code(finding.reason),
                                  named ? "" : finding.view, named ? "" : ": ", finding.message,
                                  more > 0 ? fmt::format(" (and {} more)", more) : "");
}

}  // namespace helicarm::cli

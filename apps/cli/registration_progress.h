// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <fmt/format.h>

#include "helicarm/case_registration/register_case.h"
#include "progress_line.h"

namespace helicarm::cli {

/// Says the steps of a registration and, with those that take longer than a second, the share of all searches
/// that is done.
class RegistrationProgress {
 public:
  explicit RegistrationProgress(const Console& console) : console_(console) {}

  /// Refers to this object. Nothing is said with --quiet.
  case_registration::Progress hooks() {
    if (console_.quiet) return {};
    return {[this](const std::string& model, std::string_view step) { begin(model, step); },
            {},
            [this](double share) {
              if (line_) line_->notify(share);
            }};
  }

 private:
  void begin(const std::string& model, std::string_view step) {
    const std::string words = case_registration::words_of_step(model, step);
    line_.reset();
    console_.progress << fmt::format("helicarm: {}\n", words);
    if (!console_.tags) line_.emplace(console_, words);
  }

  const Console& console_;
  std::optional<ProgressLine> line_;
};

}  // namespace helicarm::cli

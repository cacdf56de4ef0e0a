// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

pipeline::Progress Progress::of_views() const {
  pipeline::Progress progress{.view = interrupt};
  if (step) progress.stage = [this](std::string_view stage) { step("", stage); };
  return progress;
}

std::string words_of_step(const std::string& model, std::string_view step) {
  return fmt::format("{}{}{}", model, model.empty() ? "" : ": ", step);
}

Progress progress_in_words(std::function<void(const std::string&)> tell, std::function<void()> interrupt,
                           std::chrono::milliseconds between_shares) {
  using Clock = std::chrono::steady_clock;
  struct Step {
    std::string words;
    Clock::time_point told;
  };
  const auto present = std::make_shared<Step>();
  Progress progress;
  progress.interrupt = std::move(interrupt);
  progress.step = [present, tell](const std::string& model, std::string_view step) {
    *present = {words_of_step(model, step), Clock::now()};
    tell(present->words);
  };
  progress.share = [present, tell, between_shares](double share) {
    const auto now = Clock::now();
    if (now - present->told < between_shares) return;
    present->told = now;
    tell(fmt::format("{}, {:.0f} %", present->words, std::floor(100 * share)));
  };
  return progress;
}

}  // namespace helicarm::case_registration

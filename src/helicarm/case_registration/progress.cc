// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/progress.h"

#include <charconv>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>

namespace helicarm::case_registration {

pipeline::Progress Progress::of_views() const {
  pipeline::Progress progress{.view = interrupt};
  if (step) progress.stage = [this](std::string_view stage) { step("", stage); };
  return progress;
}

Progress Progress::of_model(std::size_t number, std::size_t count) const {
  Progress progress = *this;
  progress.share = part_of(share, double(number) / double(count), double(number + 1) / double(count));
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

std::optional<double> share_in(std::string_view words) {
  constexpr std::string_view unit = " %";
  const std::size_t before = words.rfind(", ");
  if (before == words.npos || !words.ends_with(unit)) return std::nullopt;
  const std::string_view number = words.substr(before + 2, words.size() - unit.size() - before - 2);
  int percent = 0;
  const auto [end, problem] = std::from_chars(number.begin(), number.end(), percent);
  if (problem != std::errc() || end != number.end() || percent < 0 || percent > 100) return std::nullopt;
  return percent / 100.0;
}

}  // namespace helicarm::case_registration

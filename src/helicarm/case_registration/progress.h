// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "helicarm/core/work_share.h"
#include "helicarm/pipeline/progress.h"

namespace helicarm::case_registration {

/// What a registration calls; an exception ends it.
struct Progress {
  /// With the model's name (empty: the views) and the step.
  std::function<void(const std::string& model, std::string_view step)> step = {};
  /// Often, from the threads that work.
  std::function<void()> interrupt = {};
  TellShare share = {};  ///< of the searches for all models

  /// Of the views' calibration. Refers to this object.
  pipeline::Progress of_views() const;
  /// Of one of `count` models, each of which has the same part of the share.
  Progress of_model(std::size_t number, std::size_t count) const;
};

/// "femur: search"; the step alone where it is of the views.
std::string words_of_step(const std::string& model, std::string_view step);

/// Tells each step as "femur: search" and, not more often, with the share: "femur: search, 40 %".
Progress progress_in_words(std::function<void(const std::string&)> tell, std::function<void()> interrupt,
                           std::chrono::milliseconds between_shares = std::chrono::seconds(1));

/// The share in words of `progress_in_words`; nothing in those without one.
std::optional<double> share_in(std::string_view words);

}  // namespace helicarm::case_registration

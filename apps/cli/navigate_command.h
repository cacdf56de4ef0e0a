// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "command.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm::cli {

struct NavigateArguments {
  std::filesystem::path plan;
  std::filesystem::path out = "session";
  std::filesystem::path picks;       ///< awaited after the images; empty: those of the plan
  std::optional<double> plan_age_s;  ///< overrides the plan's plan_stale_s
  receiver::ReceiverOptions receiver;
  bool yes = false;  ///< confirm every order automatically: for rehearsals
};

/// A whole operation from a plan: images, measurement, robot or hand-held drill, verification.
CommandResult navigate_command(const NavigateArguments& arguments, Console& console);

}  // namespace helicarm::cli

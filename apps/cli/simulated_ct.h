// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include <CLI/CLI.hpp>

#include "command.h"
#include "helicarm/simulation/ct_body.h"

namespace helicarm::cli {

/// A CT volume instead of the modelled knee.
struct CtArguments {
  std::filesystem::path path;     ///< empty: none
  std::vector<double> centre_mm;  ///< three numbers or none
  std::vector<double> turn_deg;
};

/// --ct, --ct-centre, --ct-turn.
void add_ct(CLI::App& command, CtArguments& a);
/// Null without a CT. Its warnings are told.
std::shared_ptr<const simulation::CtOptions> ct_from(const CtArguments& arguments, const Console& console);

}  // namespace helicarm::cli

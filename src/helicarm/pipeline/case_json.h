// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "helicarm/pipeline/case.h"

namespace helicarm::pipeline {

/// Use of a case: what may be left out follows from it.
enum class Purpose { run, phantom, registration, cameras, sweep };

/// Images of a case of the purpose `sweep`.
inline constexpr std::size_t most_frames = 1000;

/// Takes the tunnels that name a model out of "tunnels": the rest is a case like any other.
Json take_model_tunnels(Json& json);

/// The case with this content of case.json. Throws BadInput as `read_case` fails; `origin` begins each
/// message.
Case case_of(Json json, const std::string& origin, const std::filesystem::path& folder, Purpose purpose);

}  // namespace helicarm::pipeline

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/pipeline/case.h"

/// Picks that a case's case.json does not hold yet: unsaved_picks.json beside it, written after each change,
/// so that neither a crash nor opening another case loses them.
namespace helicarm::gui {

/// Nothing where there are none; of the views and bones of the case. Fails as `read_json` and `picks_from`.
Expected<std::optional<std::vector<pipeline::Pick>>> unsaved_picks(const std::filesystem::path& case_folder,
                                                                   const pipeline::Case& the_case);

/// Fails as `write_file`.
Expected<void> keep_unsaved(const std::filesystem::path& case_folder,
                            const std::vector<pipeline::Pick>& picks);

/// Puts them into case.json with the tunnels they complete (`with_all_picks`), and removes the unsaved ones.
Expected<void> save_picks(const std::filesystem::path& case_folder, const std::vector<pipeline::Pick>& picks,
                          const std::vector<pipeline::CaseTunnel>& tunnels);

}  // namespace helicarm::gui

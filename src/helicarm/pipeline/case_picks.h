// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/core/csv.h"
#include "helicarm/core/json.h"
#include "helicarm/pipeline/case.h"

namespace helicarm::pipeline {

/// case.json with further picks.
struct PickedCase {
  Json json;
  std::size_t added = 0, replaced = 0;
};

/// Adds the picks of a table name, view, u_px, v_px[, sigma_px] (raw px) to a case.json. A pick of the same
/// name and view takes the table's pixel and keeps its other keys; a new one takes `moves_with` and
/// `bone` from the picks of its name. Refuses what `case_from_json` refuses of the result, and a table
/// without rows, of another view or that gives a pick twice. `origin` (a file name) begins each message of
/// the table.
Expected<PickedCase> with_picks(Json json, const CsvTable& table, const std::string& origin,
                                const std::filesystem::path& folder);

/// Refuses (bad_value) a row whose pixel lies outside the image of its view, as `locate_case` would; fails as
/// `image_of`.
Expected<void> check_in_images(const CsvTable& table, const std::string& origin, const Case& the_case);

/// A case.json with these picks in place of its own, and with those tunnels that it does not name and whose
/// ends are picked. Fails as `case_from_json` of the result: a tunnel of the case must keep its ends.
Expected<Json> with_all_picks(Json json, const std::vector<Pick>& picks,
                              const std::vector<CaseTunnel>& tunnels, const std::filesystem::path& folder);

}  // namespace helicarm::pipeline

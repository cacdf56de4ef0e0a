// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/measures/measure.h"

namespace helicarm::measures {

/// Where a publication found or proposes a point, per cent.
struct Zone {
  /// Of one component; nothing: not stated.
  struct Extent {
    std::optional<double> centre, low, high;
  };
  Kind kind;
  std::string name;
  std::string source;
  std::vector<Extent> extents;  ///< by the kind's components
};

/// `helicarm-zones/1`: the zones that are built in, each with its source, as JSON text.
const std::string& usual_zones_text();
Expected<std::vector<Zone>> zones_from(const Json& json, const std::string& origin);

/// A position against a zone.
struct ZoneFit {
  std::string zone, source;
  std::vector<std::optional<double>> from_centre;  ///< by components, per cent
  bool is_outside = false;                         ///< of a range, by more than its 95 % error
};

/// Against the zones of its kind.
std::vector<ZoneFit> zone_fits(Kind kind, const Position& position, std::span<const Zone> zones);
Json to_json(const ZoneFit& fit, Kind kind);
/// "depth +2.1 % from the centre of ACL, femoral (Bernard 1997)".
std::string sentence_of(const ZoneFit& fit, Kind kind);

}  // namespace helicarm::measures

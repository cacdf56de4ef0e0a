// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/plate.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const phantom::Plate& plate) { return to_json(plate); }

}  // namespace

void run(std::string_view bytes) {
  run_round_trip(
      bytes, [](const Json& json) { return phantom::plate_from_json(json, "plate.json"); }, write);
}

std::vector<std::string> seeds() {
  phantom::Plate hexagonal{"holes",     phantom::DotKind::holes, phantom::Lattice::hexagonal, 10.0, 2.0, {},
                           std::nullopt};
  phantom::Plate few = phantom::plate48();
  few.dots_mm.resize(4);
  return {write(phantom::plate48()).dump(), write(hexagonal).dump(), write(few).dump()};
}

}  // namespace helicarm::fuzz

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/plate.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/codec.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom/schemas.h"

namespace helicarm::phantom {
namespace {

constexpr std::size_t most_dots = 20000;
constexpr Range pitch_range{1, 200};
constexpr double lattice_tolerance_mm = 0.1;
constexpr std::array<std::string_view, 2> dot_words{"balls", "holes"};
constexpr std::array<std::string_view, 2> lattice_words{"square", "hexagonal"};

std::vector<Eigen::Vector2d> dots_from(JsonReader& reader) {
  const Json& raw = reader.raw("dots_xy_mm");
  if (raw.is_null()) return {};
  if (!raw.is_array() || raw.empty() || raw.size() > most_dots)
    reader.refuse(Reason::bad_value, "dots_xy_mm", fmt::format("must be 1 to {} dots, or null", most_dots));
  const auto values = reader.matrix("dots_xy_mm", raw.size(), 2, {-1000, 1000});
  std::vector<Eigen::Vector2d> dots;
  std::set<std::pair<double, double>> places;
  for (std::size_t i = 0; i < values.size(); i += 2) {
    dots.emplace_back(values[i], values[i + 1]);
    if (!places.emplace(values[i], values[i + 1]).second)
      reader.refuse(Reason::bad_value, "dots_xy_mm",
                    fmt::format("dot ({}, {}) is given twice", values[i], values[i + 1]));
  }
  return dots;
}

Json json_of_dots(const std::vector<Eigen::Vector2d>& dots) {
  Json json;
  for (const auto& dot : dots) json.push_back({dot.x(), dot.y()});
  return json;
}

/// plate.json (docs/formats.md).
template <class Codec, class PlateValue>
void describe_plate(Codec& codec, PlateValue& plate) {
  codec.text("name", plate.name, "of the plate", {0, 200});
  codec.required_choice("kind", plate.kind, dot_words, "what the dots are");
  codec.required_choice("lattice", plate.lattice, lattice_words, "of the dots");
  codec.number("pitch_mm", plate.pitch_mm, pitch_range, "distance of neighbouring dots, if it is known");
  codec.number("diameter_mm", plate.diameter_mm, {0.1, 30}, "of a dot, below the pitch");
  codec.custom(
      "dots_xy_mm", false,
      {{"type", "array"}, {"minItems", 1}, {"maxItems", most_dots}, {"items", {{"type", "array"}}}},
      "1 to 20000 distinct `[x, y]`, each within -1000 to 1000 mm and within 0.1 mm of a lattice of that "
      "pitch in any "
      "rotation and translation; `null`: unbounded lattice",
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<PlateValue>) plate.dots_mm = dots_from(reader);
      },
      [&] { return std::optional(json_of_dots(plate.dots_mm)); });
  codec.number("height_above_receiver_mm", plate.height_above_receiver_mm, {0, 1000}, "of the dots' plane");
}

}  // namespace

Plate plate48() {
  Plate plate{"plate48", DotKind::balls, Lattice::square, 25.0, 2.5, {}, 15.0};
  for (int row = -3; row <= 3; ++row)
    for (int column = -3; column <= 3; ++column)
      if (row != 0 || column != 0) plate.dots_mm.emplace_back(25.0 * column, 25.0 * row);
  return plate;
}

Expected<Plate> plate_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    Plate plate;
    FromJson codec(reader);
    describe_plate(codec, plate);
    reader.finish();
    if (plate.pitch_mm && plate.diameter_mm >= *plate.pitch_mm)
      reader.refuse(Reason::bad_value, "diameter_mm",
                    fmt::format("{} must be below the pitch of {} mm", plate.diameter_mm, *plate.pitch_mm));
    if (plate.pitch_mm &&
        !lattice_misfit(plate.dots_mm, plate.lattice, *plate.pitch_mm, lattice_tolerance_mm))
      reader.refuse(
          Reason::bad_value, "dots_xy_mm",
          fmt::format("the dots are not within {} mm of a {} lattice of pitch {} mm", lattice_tolerance_mm,
                      plate.lattice == Lattice::square ? "square" : "hexagonal", *plate.pitch_mm));
    return plate;
  });
}

Expected<Plate> read_plate(const std::filesystem::path& path) {
  return read_json(path).and_then(
      [&](const Json& json) { return plate_from_json(json, path.filename().string()); });
}

Expected<Plate> plate_named(const std::string& name_or_path, const std::filesystem::path& folder) {
  if (Plate built_in = plate48(); name_or_path == built_in.name) return built_in;
  return path_inside(folder, name_or_path).and_then(read_plate).map_error([](Failure failure) {
    if (failure.reason == Reason::missing_file)
      failure.message += fmt::format("; the built-in plate is \"{}\"", plate48().name);
    return failure;
  });
}

Json to_json(const Plate& plate) {
  ToJson codec(ToJson::Unset::null);
  describe_plate(codec, plate);
  return std::move(codec.json);
}

Json plate_schema() {
  const Plate shape;
  return schema_of("plate.json", [&](ToSchema& codec) { describe_plate(codec, shape); });
}

}  // namespace helicarm::phantom

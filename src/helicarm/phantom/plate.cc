// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/plate.h"

#include <algorithm>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/files.h"

namespace helicarm::phantom {
namespace {

constexpr std::size_t most_dots = 20000;
constexpr Range pitch_range{1, 200};
constexpr double lattice_tolerance_mm = 0.1;

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
    plate.name = reader.text("name");
    plate.kind = static_cast<DotKind>(reader.choice("kind", {"balls", "holes"}));
    plate.lattice = static_cast<Lattice>(reader.choice("lattice", {"square", "hexagonal"}));
    plate.pitch_mm = reader.optional_number("pitch_mm", pitch_range);
    plate.diameter_mm = reader.number("diameter_mm", {0.1, 30});
    plate.dots_mm = dots_from(reader);
    plate.height_above_receiver_mm = reader.optional_number("height_above_receiver_mm", {0, 1000});
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
  const auto or_null = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  Json json{{"name", plate.name},
            {"kind", plate.kind == DotKind::balls ? "balls" : "holes"},
            {"lattice", plate.lattice == Lattice::square ? "square" : "hexagonal"},
            {"pitch_mm", or_null(plate.pitch_mm)},
            {"diameter_mm", plate.diameter_mm},
            {"dots_xy_mm", nullptr},
            {"height_above_receiver_mm", or_null(plate.height_above_receiver_mm)}};
  for (const auto& dot : plate.dots_mm) json["dots_xy_mm"].push_back({dot.x(), dot.y()});
  return json;
}

}  // namespace helicarm::phantom

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/landmark_table.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/csv.h"

namespace helicarm::measures {
namespace {

TableLandmark landmark_of(const CsvTable& rows, std::size_t row, std::string where) {
  const std::string& name = rows.text(row, "name");
  const auto x = rows.optional_number(row, "x_mm"), y = rows.optional_number(row, "y_mm"),
             z = rows.optional_number(row, "z_mm");
  const double sigma = rows.optional_number(row, "sigma_mm").value_or(0);
  if (sigma < 0)
    throw BadInput(Reason::bad_value, fmt::format("{}: sigma_mm: {:g} is negative", where, sigma));
  if (!x && !y && !z) return {name, std::nullopt, std::move(where)};
  if (!x || !y || !z)
    throw BadInput(Reason::bad_value, fmt::format("{}: x_mm, y_mm, z_mm: all three or none", where));
  return {name, Landmark{name, {*x, *y, *z}, sigma * sigma * Eigen::Matrix3d::Identity()}, std::move(where)};
}

}  // namespace

Expected<std::vector<LandmarkSet>> read_landmark_table(const std::filesystem::path& path) {
  return guarded([&] {
    const auto rows = value_or_throw(
        read_csv(path, {"measure", "kind", "model", "name", "x_mm", "y_mm", "z_mm"}, {"sigma_mm"}));
    std::vector<LandmarkSet> sets;
    for (std::size_t row = 0; row < rows.rows(); ++row) {
      const std::string where = fmt::format("{}: row {}", path.filename().string(), row + 1);
      const std::string &name = rows.text(row, "measure"), &model = rows.text(row, "model");
      const auto kind = kind_named(rows.text(row, "kind"));
      if (!kind || info_of(*kind).components.empty())
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: kind: \"{}\" is none of: femoral_quadrants, tibia_ap, tibia_ml",
                                   where, rows.text(row, "kind")));
      auto set = std::ranges::find(sets, name, &LandmarkSet::name);
      if (set == sets.end()) set = sets.insert(sets.end(), {name, model, *kind});
      if (set->kind != *kind || set->model != model)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: measure \"{}\" has another kind or model before", where, name));
      set->landmarks.push_back(landmark_of(rows, row, where));
    }
    return sets;
  });
}

}  // namespace helicarm::measures

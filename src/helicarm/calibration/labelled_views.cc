// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/labelled_views.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

namespace helicarm::calibration {
namespace {

using fiducials::Fiducial;
using fiducials::FiducialStatus;

constexpr double same_place_mm = 1e-6;

void refuse_twice(const std::vector<std::string>& names, const char* what, const std::string& view) {
  std::set<std::string> seen;
  for (const std::string& name : names)
    if (!seen.insert(name).second)
      throw BadInput({Reason::name_clash, fmt::format("{} \"{}\" is given twice", what, name), view, {}});
}

/// All views' fiducials, without an image.
std::vector<Fiducial> all_fiducials(const std::vector<ViewFiducials>& views) {
  std::vector<Fiducial> known;
  for (const ViewFiducials& view : views) {
    std::vector<std::string> labels;
    for (const Fiducial& fiducial : view.fiducials) labels.push_back(fiducial.label);
    refuse_twice(labels, "label", view.name);
    for (const Fiducial& fiducial : view.fiducials) {
      const auto before = std::ranges::find(known, fiducial.label, &Fiducial::label);
      if (before == known.end()) {
        known.push_back({fiducial.label, fiducial.centre_in_calibrator});
        continue;
      }
      const double apart = (before->centre_in_calibrator - fiducial.centre_in_calibrator).norm();
      if (apart > same_place_mm)
        throw BadInput({Reason::bad_value,
                        fmt::format("{} is {:.3g} mm from its coordinates in another view: give each "
                                    "fiducial its own label",
                                    fiducial.label, apart),
                        view.name,
                        {{"distance_mm", apart}, {"limit_mm", same_place_mm}}});
    }
  }
  return known;
}

void reorder(ViewFiducials& view, std::vector<Fiducial> order) {
  std::map<std::size_t, Eigen::Index> row_of;  // place in the order to row of the map's covariance
  for (const Fiducial& fiducial : view.fiducials) {
    const auto found = std::ranges::find(order, fiducial.label, &Fiducial::label);
    const auto index = std::size_t(found - order.begin());
    *found = fiducial;
    if (fiducial.status == FiducialStatus::used) row_of.emplace(index, Eigen::Index(row_of.size()));
  }
  view.fiducials = std::move(order);
  if (view.map_covariance_px2.size() == 0) return;
  std::vector<Eigen::Index> rows;
  for (const auto& [index, row] : row_of) rows.push_back(row);
  view.map_covariance_px2 = Eigen::MatrixXd(view.map_covariance_px2(rows, rows));
}

}  // namespace

Expected<std::vector<ViewFiducials>> aligned_by_label(std::vector<ViewFiducials> views) {
  return guarded([&] {
    std::vector<std::string> names;
    for (const ViewFiducials& view : views) names.push_back(view.name);
    refuse_twice(names, "view", {});
    const std::vector<Fiducial> order = all_fiducials(views);
    for (ViewFiducials& view : views) reorder(view, order);
    return std::move(views);
  });
}

Expected<std::vector<Warning>> check_handedness(std::span<const CalibratedView> views,
                                                std::span<const std::optional<bool>> mirrored) {
  std::vector<Warning> warnings;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool is_mirrored = views[i].view.intrinsics.fx < 0;
    if (mirrored[i] && *mirrored[i] != is_mirrored)
      return tl::unexpected<Failure>(
          Failure{Reason::ambiguous_handedness,
                  fmt::format("the view is {}mirrored, it is stated to be {}", is_mirrored ? "" : "not ",
                              is_mirrored ? "not mirrored" : "mirrored"),
                  views[i].name,
                  {}});
    if (is_mirrored && !mirrored[i])
      warnings.push_back(
          {Reason::ambiguous_handedness,
           "the points fit a mirrored image only: u and v are exchanged, v runs upwards, or the "
           "image is mirrored, which can be stated",
           views[i].name,
           {{"fx_px", views[i].view.intrinsics.fx}}});
  }
  if (warnings.empty() || warnings.size() < views.size()) return warnings;
  return fail(Reason::ambiguous_handedness,
              "the points of every view fit a mirrored image only: u and v are exchanged, v runs upwards, an "
              "axis of the calibrator has the wrong sign, or the images are mirrored, which must be stated",
              {{"views", double(views.size())}});
}

}  // namespace helicarm::calibration

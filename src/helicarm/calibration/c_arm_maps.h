// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/rectification/map_field.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::calibration {

/// A map beside what others predict of it.
struct MapCheck {
  double error_px = 0;       ///< per axis, root mean square over the field
  double of_one_map_px = 0;  ///< of the mean of the others
  double predicted_px = 0;   ///< what the model expects of `error_px`
};

/// Distortion of an intensifier over the C-arm's positions: the earth's field turns against it. Displacements
/// are a Gaussian process over the position (Rasmussen and Williams 2006, 2.2), the same for all places of
/// the field, with a constant mean.
struct CArmMaps {
  std::vector<HistoryEntry> entries;  ///< `entries_with_latest_maps`
  rectification::MapField field;
  std::vector<Eigen::MatrixX2d> displacements;  ///< of each entry's map, at the field's places, px
  double repeat_share = 0;  ///< of the variance, from one acquisition to the next in one position
  rectification::MapVariation variation;
};

/// The map of an image's own plate (in it, or of a plate image beside it); nothing of any other map, which
/// tells nothing new.
std::optional<PlateMap> plate_map_of(const rectification::Rectification& rectification);

/// Fits share and variation to the entries' maps, from what each is off its prediction by the others; without
/// a map there is no model.
std::optional<CArmMaps> c_arm_maps(std::span<const HistoryEntry> entries);

/// Each of the model's maps beside a model of the others; nothing of a single map.
std::vector<MapCheck> leave_one_out(const CArmMaps& model);

/// Whether a map is of the image size and the field of the model's.
bool is_of_their_field(const CArmMaps& model, const PlateMap& plate);

/// An acquisition's map, of their field, beside the model, which does not hold it.
MapCheck check_map(const CArmMaps& model, const HistoryEntry& acquired);

/// Whether the maps say little more of these angles than their mean: none are stated, or no map is near.
bool is_far_from_maps(const CArmMaps& model, std::optional<double> primary_deg,
                      std::optional<double> secondary_deg);

/// The map of an image at these angles, with its covariance; without angles it is the mean.
rectification::DistortionMap map_at(const CArmMaps& model, std::optional<double> primary_deg,
                                    std::optional<double> secondary_deg);

}  // namespace helicarm::calibration

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
  std::size_t entry = 0;     ///< index in the model
  double error_px = 0;       ///< per axis, root mean square over the field
  double of_one_map_px = 0;  ///< of the mean of the others
  double predicted_px = 0;   ///< what the model expects of `error_px`
};

/// Distortion of an intensifier over the C-arm's positions: the earth's field turns against it. Displacements
/// are a Gaussian process over the position (Rasmussen and Williams 2006, 2.2), the same for all places of
/// the field, with a constant mean.
struct CArmMaps {
  /// That have a map, of the latest one's image size and pixel size; of one position the latest few.
  std::vector<HistoryEntry> entries;
  rectification::MapField field;
  std::vector<Eigen::MatrixX2d> displacements;  ///< of each entry's map, at the field's places, px
  double repeat_share = 0;  ///< of the variance, from one acquisition to the next in one position
  rectification::MapVariation variation;
  std::vector<MapCheck> checks;  ///< of each entry, from two on
};

/// Keeps the map of an image's own plate (in it, or of a plate image beside it) in its entry; any other map
/// tells nothing new.
void keep_map(HistoryEntry& entry, const rectification::Rectification& rectification);

/// Fits share and variation to the entries' maps, from what each is off its prediction by the others; without
/// a map there is no model.
std::optional<CArmMaps> c_arm_maps(std::span<const HistoryEntry> entries);

/// An acquisition's own map beside the model, which does not hold it; nothing without a map of this image
/// size.
std::optional<MapCheck> check_map(const CArmMaps& model, const HistoryEntry& acquired);

/// Whether the maps say little more of these angles than their mean: none are stated, or no map is near.
bool is_far_from_maps(const CArmMaps& model, std::optional<double> primary_deg,
                      std::optional<double> secondary_deg);

/// The map of an image at these angles, with its covariance; without angles it is the mean.
rectification::DistortionMap map_at(const CArmMaps& model, std::optional<double> primary_deg,
                                    std::optional<double> secondary_deg);

}  // namespace helicarm::calibration

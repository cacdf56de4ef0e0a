// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Labels of a label map (whole numbers from 1 to 65535) with their numbers of voxels; nothing for a volume
/// that is none: other values, or over 150 of them (an interpolated mask).
std::optional<std::map<int, std::size_t>> labels_in(const Volume& volume);

/// Puts the voxels of a map in the order of the CT's where its axes are only exchanged or reversed (a NIfTI
/// of a DICOM series): then its grid is the CT's. A map of a part of the grid, as 3D Slicer saves segments,
/// is filled up with 0, from the CT's first voxel on only if it `may_be_part`. False, and the map as it was,
/// if it lies on another grid.
bool onto_grid(Volume& map, const Volume& ct, bool may_be_part = false);

/// Refuses (bad_value) labels that a map lacks, with those that there are, and a volume that is no label map;
/// `origin` begins the message.
Expected<void> check_labels(const Volume& map, std::span<const int> labels, const std::string& origin);

/// Refuses (bad_value) several labels, which are listed; `key` makes the choice.
Expected<void> one_label(const std::map<int, std::size_t>& labels, const std::string& origin,
                         const std::string& key);

/// The mask that is meant by a volume: of the stated label, or all that is not 0 where there is one label; of
/// a mask of shares (0 to 1, or over 150 whole numbers up to 255 or 65535) what reaches the stated share.
/// Refuses (bad_value) shares without one and one without shares, and values between whole numbers over 1: an
/// interpolated label map; else fails as `check_labels` and `one_label`. `key`: "mask", whose "mask_label"
/// and "mask_threshold" the messages name.
Expected<void> choose_mask(Volume& mask, std::optional<int> label, std::optional<double> threshold,
                           const std::string& origin, const std::string& key);

}  // namespace helicarm::volume

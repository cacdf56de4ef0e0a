// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "helicarm/volume/volume.h"

namespace helicarm::volume {

/// Reads MetaImage (.mha, .mhd), NRRD (.nrrd, .nhdr), NIfTI-1 and NIfTI-2 (.nii, .nii.gz, or either file of a
/// pair of .hdr and .img, each plain or .gz), or a DICOM segmentation (BINARY, LABELMAP; a label map of the
/// slices that hold a segment), detected by content, or a folder with the slices of a DICOM CT series. Every
/// length in a file is checked before use. Failures name file and field; codes: missing_file, not_an_image,
/// truncated, bad_size, bad_value, unsupported, not_finite, unknown_key, path_outside, name_clash,
/// patient_mismatch (slices of one series that name different patients).
Expected<Volume> read_volume(const std::filesystem::path& path);

/// A slice of the CT series that `read_volume` reads of a folder, one that states its frame of reference if
/// any does; nothing for a file, and for a folder without a CT slice. Refuses name_clash as `read_volume`,
/// and slices of two patients or frames of reference (patient_mismatch, bad_value).
Expected<std::optional<std::filesystem::path>> slice_of_series(const std::filesystem::path& folder);

/// The other file of a NIfTI pair, by the name of one (.hdr, .img, each plain or .gz); nothing for a file of
/// another name. Fails with missing_file, and with name_clash where it exists both plain and packed.
Expected<std::optional<std::filesystem::path>> other_of_pair(const std::filesystem::path& path);

/// Numbers and labels of the segments of a DICOM segmentation; nothing for another file or a folder.
Expected<std::optional<std::map<int, std::string>>> segments_in(const std::filesystem::path& path);

/// Which segment of a DICOM segmentation is meant.
struct SegmentChoice {
  std::optional<int> number = {};
  std::optional<std::string> label = {};
  std::optional<double> threshold = {};  ///< share from which a voxel of a FRACTIONAL one belongs to it
  std::string key = "mask";              ///< of the file in its case, whose keys make the choice
};

/// The mask of one segment (1 inside, 0 elsewhere; slices without a segment may be missing), also where it
/// overlaps others; nothing for another file or a folder. BINARY, FRACTIONAL or LABELMAP, uncompressed or
/// deflated; bytes and words also compressed without loss. Refuses (bad_value) a choice that fits no or
/// several segments, none of several, and a threshold that is missing or not needed; the segments are listed.
/// Fails as `read_volume`.
Expected<std::optional<Volume>> read_segment(const std::filesystem::path& path, const SegmentChoice& choice);

/// Whether a file is named as the voxels of a NIfTI pair (.img, .img.gz).
bool is_named_as_voxels(const std::filesystem::path& path);

}  // namespace helicarm::volume

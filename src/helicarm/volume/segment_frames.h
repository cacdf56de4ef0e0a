// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/xray/dicom_tags.h"

namespace helicarm::volume {

enum class SegmentationKind { binary, fractional, label_map };

inline constexpr xray::DicomTag segmentation_type{0x00620001, "Segmentation Type"};

/// A frame shows one segment in one slice, of a LABELMAP (segment 0) all of them. Columns of `axes`: along a
/// row, along a column, mm per pixel.
struct SegmentFrame {
  int segment = 0;
  Eigen::Vector3d corner;
  Eigen::Matrix<double, 3, 2> axes;
  std::optional<double> spacing, thickness;
  int slice = 0;

  Eigen::Vector3d normal() const { return axes.col(0).cross(axes.col(1)).normalized(); }
  double along(const Eigen::Vector3d& direction) const { return direction.dot(corner); }
};

/// An element that must be there and lie in its limits; these throw BadInput.
int word_in(const xray::DicomElements& elements, xray::DicomTag tag, int low);

/// By Segmentation Type, another than which is refused.
SegmentationKind kind_of(const xray::DicomElements& elements);

/// By number, without 0, which is a label map's background.
std::map<int, std::string> segments_of(const xray::DicomElements& elements);

/// In the order of the file, one orientation and spacing. Throws BadInput, also where `SegmentValues` could
/// not read the values (bits, compression, none).
std::vector<SegmentFrame> frames_of(const xray::DicomElements& elements);

/// Numbers the slices and returns the step between them. Frames are sorted along the normal.
Eigen::Vector3d place_frames(std::vector<SegmentFrame>& frames, const std::string& origin);

}  // namespace helicarm::volume

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/pipeline/result.h"
#include "helicarm/report/table.h"

namespace helicarm::report {

// The result as every output shows it: HTML, PDF, terminal and application. Lengths in mm, positions in
// images in px, points in the calibrator's frame at the first view's acquisition.

/// "view: message (code)".
std::string message_of(const Failure& failure);

/// A result in one number.
struct KeyFigure {
  std::string value, unit, what;
};
std::vector<KeyFigure> key_figures(const pipeline::Result& result);

/// Position of each point with its errors; a point that is not located has a reason in place of them.
Table positions_table(const std::vector<pipeline::PointResult>& points);

/// A tunnel's end and the tool: by tracker and X-ray images, and by the X-ray images alone.
struct ToolAtEnd {
  std::string tunnel, end;
  std::optional<double> distance_mm, predicted_mm;  ///< with the tracker
  std::optional<guidance::LineError> in_images;
  std::optional<guidance::TipDepth> depth = {};  ///< of a drill's tip
};
/// "start" and "end" of each tool line, where located, and "tip" of a drill whose depth was measured.
std::vector<ToolAtEnd> tools_at_ends(const std::vector<guidance::Verification>& lines);

/// A planned tunnel against the bone of its model.
struct TunnelInBoneRow {
  std::string tunnel, model;
  guidance::BoneCheck check;
};
Table bone_table(const std::vector<TunnelInBoneRow>& tunnels);
/// Of the result's models.
Table bone_table(const pipeline::Result& result);

Table statistics_table(const localization::Accuracy& accuracy);
Table targets_table(const localization::Accuracy& accuracy);
Table points_table(const std::vector<pipeline::PointResult>& points);
Table tunnels_table(const pipeline::Result& result);
Table verification_table(const std::vector<ToolAtEnd>& tools);
Table calibration_table(const std::vector<pipeline::ViewResult>& views);
Table fiducials_table(const std::vector<pipeline::ViewResult>& views);
Table rectification_table(const std::vector<pipeline::ViewResult>& views);
Table timing_table(const pipeline::Timing& timing);

/// All tables in the report's order, without those that have no row and without empty columns.
std::vector<Table> tables_of(const pipeline::Result& result);

}  // namespace helicarm::report

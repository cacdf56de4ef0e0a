// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/pipeline/case_model.h"

namespace helicarm::case_registration {

using PlanPoint = pipeline::PointInModel;

/// A line of the plan: its first point is the tunnel's start.
struct MarkupLine {
  std::string name;
  std::size_t start = 0, end = 0;  ///< among the points
  // Of the case's tunnel of this line.
  std::optional<double> diameter_mm = {}, bridge_mm = {};
  bool enters_at_end = false;
};

struct MarkupPlan {
  std::vector<PlanPoint> points;
  std::vector<MarkupLine> tunnels;
};

/// Reads 3D Slicer's markups: of a .mrk.json point lists give points, lines give tunnels with points
/// NAME_start and NAME_end; a line without a name is called as the file. An .fcsv holds points. RAS and LAS
/// are converted to LPS, other units of length to mm. Fails with missing_file, bad_json, not_finite,
/// bad_value, bad_size, truncated, unsupported, name_clash.
Expected<MarkupPlan> read_plan(const std::filesystem::path& path);

/// Landmarks in a model, mm, each name once: a CSV of name,x_mm,y_mm,z_mm, or the points of Slicer's markups
/// (.mrk.json, .fcsv). Throws BadInput: as `read_plan`, and unknown_key.
std::vector<PlanPoint> read_landmarks(const std::filesystem::path& path);

/// The landmarks of a model's start: those placed, else those of its file; empty without either. Throws as
/// `read_landmarks`.
std::vector<PlanPoint> start_landmarks(const pipeline::CaseModel& model);
/// Where they come from, for messages; empty without any.
std::string source_of_landmarks(const pipeline::CaseModel& model);

}  // namespace helicarm::case_registration

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <ranges>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/guidance/bone_check.h"
#include "helicarm/guidance/guide.h"
#include "helicarm/guidance/tunnel.h"
#include "helicarm/guidance/verify.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::calibration {
struct CArmMaps;
}

namespace helicarm::pipeline {

/// The step of a measurement whose result a finding concerns.
enum class Stage { read, rectify, label, calibrate, locate, registration };

/// A warning or a note of a measurement.
struct Finding : Warning {
  Stage stage;
};

struct RunOptions {
  rectification::Method method = rectification::Method::best;
  std::optional<double>
      max_error_mm;      ///< refuse (uncertain) if a point's 95 % error, also in the tool's frame, exceeds it
  unsigned threads = 0;  ///< 0: all cores
  std::optional<calibration::CArmHistory> history = {};  ///< C-arm history, used as prior
  /// Distortion over the C-arm's positions, for views without plate and map; by default that of `history`.
  std::shared_ptr<const calibration::CArmMaps> maps = {};
  /// Motion of an untracked bone between the acquisitions, per axis; in the covariance of its points.
  double motion_sigma_mm = 0;
  /// Folder for the maps of plate images (`plate_image_map`), which changes no result; nothing: none are
  /// kept.
  std::optional<std::filesystem::path> cache = {};
};

/// Results of the stages for one view; absent if not reached.
struct ViewResult {
  std::string name;
  std::shared_ptr<const xray::XrayImage> xray_image;
  std::optional<rectification::Rectification> rectification;
  std::optional<fiducials::LabelledFiducials> found;  ///< with residuals and rejections after calibration
  std::optional<calibration::CalibratedView> calibrated;
  std::optional<detection::ImageDots> dots = {};
  std::vector<fiducials::GuessedLabel> guessed = {};  ///< the best labelling where it was refused
  /// Of the bones whose marker was read at the acquisition, with the calibrator's.
  std::map<guidance::Bone, geometry::RigidTransform> calibrator_from_bone = {};
};

/// The dots that may be fiducials, of a view whose labelling was refused; else none.
std::vector<detection::Dot> unlabelled_candidates(const ViewResult& view);

/// One pick or check target: observations and position, or the reason why it was not located.
struct PointResult {
  std::string name;
  localization::PointSource source;
  std::optional<guidance::Bone> moves_with;
  std::vector<std::optional<fiducials::ImagePoint>> seen;  ///< one per view
  std::optional<guidance::PointInFrames> place;
  double ray_gap_mm = 0;
  std::optional<Failure> reason;                   ///< if not located
  bool rays_miss = false;                          ///< ray gap larger than the errors explain
  std::vector<Warning> warnings = {}, notes = {};  ///< of this point
};

/// A planned tunnel's start and end, as indices among the points.
struct TunnelEnds {
  std::size_t start;
  std::size_t end;
};

/// A point of a registered model's plan.
struct ModelPoint {
  std::string model;
  std::string name;
  guidance::PointInFrames place;
};

/// A tunnel of a registered model's plan.
struct ModelTunnel {
  std::string model;
  guidance::Tunnel tunnel;
  TunnelEnds ends;  ///< among the model points
  /// Of the model's pose, to which its ends' `by_calibration` refers; empty: none.
  Eigen::MatrixXd shared_covariance = {};
  std::optional<guidance::BoneCheck> bone_check = {};  ///< nothing: the model has no outline
};

/// Wall-clock time of each stage, ms; nothing if not reached.
struct Timing {
  std::optional<double> read, rectify, detect, label, calibrate, locate, total;
};

/// Metadata of the calibrator's file.
struct CalibratorSource {
  std::string name;
  double tolerance_mm = 0;
  double scale_sigma = 0;
  Json measured = nullptr;  ///< how its coordinates were obtained
  std::vector<phantom::CalibratorBall> balls;
};

struct CaseCalibration;

/// Measurement of a case (`helicarm run`); after a refusal, all results computed before it.
struct Result {
  RunOptions options;
  std::optional<Failure> failure;
  std::optional<Stage> refused_at;  ///< whose result the failure concerns
  std::vector<Finding> warnings;
  std::vector<Finding> notes;  ///< valid for all data of this kind
  CalibratorSource calibrator;
  std::vector<guidance::Bone> bones;  ///< of the case
  std::vector<ViewResult> views;
  std::shared_ptr<const CaseCalibration> calibration;  ///< null: not reached
  std::vector<PointResult> points;
  localization::Accuracy accuracy;
  std::vector<TunnelEnds> tunnel_ends;
  std::vector<guidance::Tunnel> tunnels;
  std::vector<ModelPoint> model_points;  ///< of the models that were registered and not refused
  std::vector<ModelTunnel> model_tunnels;
  std::vector<guidance::ToolLine> tool_lines;
  std::vector<guidance::Verification> verifications;
  Timing timing_ms;
};

/// Of all views' parameters (`Calibration::joint_covariance`); empty: not computed.
Eigen::MatrixXd joint_covariance(const Result& result);

/// A calibrated view as if what moves with this bone had stayed where it was at the first view's acquisition,
/// where points and tool lines are given. Without a bone, or its pose in both views: the view itself.
geometry::View view_of_bone(const Result& result, std::size_t index,
                            const std::optional<guidance::Bone>& bone);
/// All of them, which must be calibrated.
std::vector<geometry::View> views_of_bone(const Result& result, const std::optional<guidance::Bone>& bone);

/// result.json (docs/formats.md): all keys, null if not computed.
Json to_json(const Result& result);

/// The JSON Schema of result.json.
Json result_schema();

/// As in result.json: code, message, view and figures.
Json to_json(const Failure& failure);

/// A list of failures, warnings or findings.
template <std::ranges::range Failures>
Json json_list_of(const Failures& failures) {
  Json list = Json::array();
  for (const Failure& failure : failures) list.push_back(to_json(failure));
  return list;
}

}  // namespace helicarm::pipeline

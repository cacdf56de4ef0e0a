// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/c_arm_history.h"
#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/guidance/guide.h"
#include "helicarm/guidance/tunnel.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/verification/verify.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

struct RunOptions {
  Method method = Method::best;
  std::optional<double>
      max_error_mm;      ///< refuse (uncertain) a point whose error exceeds this in more than 5 % of cases
  unsigned threads = 0;  ///< 0: all cores
  std::optional<CArmHistory> history = {};  ///< the C-arm's history, which then serves as a prior
  /// Motion of an untracked bone between the acquisitions, per axis; enters the covariance of its points.
  double motion_sigma_mm = 0;
  /// Called before each stage, in the calling thread, with its name as in Timing. What it throws ends the
  /// run.
  std::function<void(std::string_view stage)> on_stage = {};
};

/// All that the stages made of one exposure; what was not reached is absent.
struct ViewResult {
  std::string name;
  std::shared_ptr<const XrayImage> xray_image;
  std::optional<Rectification> rectification;
  std::optional<LabelledFiducials> found;  ///< after calibration with its residuals and rejections
  std::optional<CalibratedView> calibrated;
};

/// One pick or check target: where it was seen and where it is, or why it could not be located.
struct PointResult {
  std::string name;
  PointSource source;
  std::optional<Bone> moves_with;
  std::vector<std::optional<ImagePoint>> seen;  ///< one per view
  std::optional<PointInFrames> place;
  double ray_gap_mm = 0;
  std::optional<Failure> reason;                   ///< of an absent place
  bool rays_miss = false;                          ///< by more than their errors explain
  std::vector<Warning> warnings = {}, notes = {};  ///< that concern this point
};

/// A planned tunnel's start and end, as indices among the points.
struct TunnelEnds {
  std::size_t start;
  std::size_t end;
};

/// Wall clock of each stage, ms; nothing where it was not reached.
struct Timing {
  std::optional<double> read, rectify, detect, label, calibrate, locate, total;
};

/// What the calibrator's file says of itself.
struct CalibratorSource {
  std::string name;
  double tolerance_mm = 0;
  double scale_sigma = 0;
  Json measured = nullptr;  ///< how its coordinates were obtained, as written there
};

/// The answer of `helicarm run`. A refused case holds all that was known before the refusal.
struct Result {
  RunOptions options;
  std::optional<Failure> failure;
  std::vector<Warning> warnings;
  std::vector<Warning> notes;  ///< what holds for any data of this kind
  CalibratorSource calibrator;
  std::vector<ViewResult> views;
  Eigen::MatrixXd joint_covariance;          ///< of all views' parameters; as CalibratedView::covariance
  std::optional<LearnedIntrinsics> history;  ///< what its history told, where one was given
  std::vector<HistoryEntry> entries;         ///< what this case adds to it
  std::vector<PointResult> points;
  Accuracy accuracy;
  std::vector<TunnelEnds> tunnel_ends;
  std::vector<Tunnel> tunnels;
  std::vector<ToolLine> tool_lines;
  std::vector<Verification> verifications;
  Timing timing_ms;
};

/// result.json (docs/formats.md): every key is there, null where not computed.
Json to_json(const Result& result);

/// As the key of result.json: code, message, view and figures.
Json to_json(const Failure& failure);

/// A list of them.
Json json_list_of(std::span<const Failure> failures);

}  // namespace helicarm

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/track/butterworth.h"
#include "helicarm/track/joint_angles.h"
#include "helicarm/track/sequence_images.h"

namespace helicarm::track {

/// One camera of the sequence.
struct TrackView : SequenceView {
  geometry::View camera;                            ///< world, mm, to rectified pixels
  std::optional<rectification::DistortionMap> map;  ///< raw to rectified; nothing: none
};

/// A marker's place in one view of the first frame; or of a later one, a correction.
struct MarkerPick {
  std::size_t marker;
  std::size_t view;
  Eigen::Vector2d uv_raw;
  std::optional<int> frame = {};  ///< of a correction
  bool operator==(const MarkerPick&) const = default;
};

/// A rigid set of markers.
struct BodyPlan {
  std::string name;
  std::vector<std::size_t> markers;
  std::vector<Eigen::Vector3d> geometry;  ///< mm, in a frame of its own, one per marker; empty: to be learnt
};

/// A case of markers through a sequence, with its cameras.
struct TrackCase {
  std::filesystem::path folder;
  std::vector<TrackView> views;
  Eigen::MatrixXd camera_covariance;  ///< 11 n x 11 n; empty: the cameras are taken as exact
  double diameter_mm = 1;
  std::optional<double> frame_rate_hz;
  std::vector<std::string> markers;
  std::vector<MarkerPick> picks;  ///< of the first frame
  /// Of later frames: the marker is at the disc nearest to it there, and is followed from there on.
  std::vector<MarkerPick> corrections = {};
  std::vector<BodyPlan> bodies;
  std::optional<Butterworth> butterworth;  ///< places filtered as laboratories do, for comparison
  std::vector<BodyAxes> axes;  ///< the first body is the reference of the others; empty: no joint angles
  std::vector<Warning> warnings;
  /// [frame][marker * views + view], raw pixels: instead of images; empty: images.
  std::vector<std::vector<std::optional<Eigen::Vector2d>>> points = {};
  double point_sigma_px = 0.3;  ///< of `points`, per axis, before their ray gaps show it
};

std::vector<std::string> names_of_views(const TrackCase& the_case);

/// A file of XMALab's 2-D points instead of the case's picks. As XMALab writes it by default: counting from
/// 0, y downwards, raw (distorted) pixels.
struct PointsFile {
  std::filesystem::path file;
  bool of_all_frames = false;  ///< no image is read, the file's points are the markers'; else those of the
                               ///< first frame are picks
  int first_frame = 1;         ///< of the file's first row
  bool from_one = false, y_up = false;
  bool undistorted = false;             ///< by XMALab: refused for a view with a distortion map
  std::optional<double> sigma_px = {};  ///< as `point_sigma_px`
};

/// Refuses a filter without a frame rate, of another order than 2 or 4, or with a cut-off that is not below
/// half the rate of every `step`-th frame.
void check_butterworth(const TrackCase& the_case, int step);

/// Reads a case with "markers", picks of the range's first frame and "bodies". Views have "camera" or
/// "calibration", or are calibrated by the case's calibrator in their first image. No later image is read.
/// Fails as `read_case`, `import_matrix`, `saved_calibration_from_json`, `calibrate_case` and
/// `read_xmalab_points2d`; bad_value for picks of another frame or outside a distortion map, for bodies of
/// unknown markers, and for frames that `points` does not have; residual_too_large where the rays of points
/// of all frames miss each other.
Expected<TrackCase> read_track_case(const std::filesystem::path& path,
                                    const case_registration::FrameRange& frames,
                                    const std::optional<PointsFile>& points = {});

}  // namespace helicarm::track

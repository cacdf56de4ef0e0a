// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/assign.h"
#include "helicarm/track/body_pose.h"
#include "helicarm/track/contrast_model.h"
#include "helicarm/track/repeated_images.h"
#include "helicarm/track/sighted_point.h"
#include "helicarm/track/track_case.h"
#include "helicarm/track/tracked.h"

namespace helicarm::track {

/// Where the markers of one frame are seen.
struct FrameSights {
  int frame = 0;
  std::vector<std::vector<std::optional<MarkerImage>>> of;  ///< [marker][view]
  int repaired = 0;  ///< markers whose disc by motion alone was another's by the bodies' geometry
  std::vector<RepeatedImage> repeated = {};  ///< images that are none of this frame
};

/// Farthest from a pick at which its disc is sought, less a radius.
inline constexpr double pick_reach_px = 6;

/// Follows markers and bodies from frame to frame. Its state is a function of the first images and of the
/// frames that it absorbed, so that an interrupted sequence goes on as if it had not been.
class Tracker {
 public:
  /// Finds the markers of the first frame by their picks. Refuses (markers_swapped, residual_too_large) picks
  /// whose rays miss each other, and (markers_swapped, bodies_exchanged) markers that contradict the geometry
  /// given; not_seen where no marker is found in two views; bad_value for picks outside a distortion map.
  static Expected<Tracker> begin(const TrackCase& the_case, int frame,
                                 const std::vector<xray::XrayImage>& images);

  const FrameSights& first() const { return first_; }
  /// Whether the view's markers are brighter than what is around them.
  bool is_bright(std::size_t view) const { return appearance_[view].polarity < 0; }
  const std::vector<Warning>& warnings() const { return warnings_; }

  /// The markers in the images of the frame after the last one absorbed; those that the case corrects there
  /// are where it says. A view whose image has no pixels shows none.
  FrameSights look(int frame, const std::vector<xray::XrayImage>& images) const;
  void absorb(const FrameSights& sights);

  /// What is known of the frame absorbed last, without the frames after it.
  struct Snapshot {
    std::vector<TrackedMarker> markers;
    std::vector<TrackedBody> bodies;
  };
  Snapshot snapshot(const FrameSights& sights) const;

 private:
  struct MarkerState {
    Eigen::Vector3d place = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero();  // mm, a frame
    double acceleration_mm = 2;  // rms of what a prediction misses, per axis
    int hidden = 0;              // frames since it was seen in two views
    bool known = false;
    std::vector<double> contrast;  // absolute, per view; 0: unknown
    std::vector<double> ratio;     // of its contrast to that of the view's markers, per view
    std::vector<int> age;          // frames since it was seen, per view
  };
  struct BodyState {
    std::vector<Eigen::Vector3d> in_body;  // of each marker
    std::vector<double> seen;              // frames that determined it; 0: unknown
    geometry::RigidTransform pose, previous, first;
    RigidCovariance covariance = RigidCovariance::Zero();
    int determining = 0;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // world, of the last pose
    double turn_rad = 0.06, shift_mm = 2;              // rms of what a prediction misses, per axis
    int poses = 0;                                     // 0: none, 1: no velocity
    int hidden = 0;                                    // frames without a pose
    double loose_mm = 0.1;
  };
  struct Delay {
    double information = 0, sum = 0;  // of the delay against the first view, frames
    double mean() const { return information > 0 ? sum / information : 0; }
    double sigma() const;
  };

  explicit Tracker(const TrackCase& the_case) : given_(&the_case) {}
  FrameSights look_freely(int frame, const std::vector<xray::XrayImage>& images) const;
  void correct(FrameSights& sights, const std::vector<xray::XrayImage>& images) const;
  bool is_corrected(std::size_t marker, int frame) const;
  /// Of a disc: discs outside the view's distortion map are left out where they are found.
  Eigen::Vector2d rectified(std::size_t view, const Eigen::Vector2d& raw) const;
  bool is_in_map(std::size_t view, const MarkerImage& image) const;
  double radius_px(std::size_t view, const Eigen::Vector3d& place) const;
  std::optional<PosePrior> predicted_pose(const BodyState& body) const;
  ExpectedMarker expected(std::size_t marker) const;
  ExpectedMarker expected(std::size_t marker, const PosePrior& pose, double wide) const;
  void expect_images(ExpectedMarker& marker, std::size_t index, const Eigen::Vector3d& velocity) const;
  std::vector<std::vector<Candidate>> search(const std::vector<xray::XrayImage>& images,
                                             const std::vector<ExpectedMarker>& markers,
                                             std::optional<double> reach_px) const;
  std::optional<PoseFit> pose_of(const BodyState& body, const BodyPlan& plan,
                                 const FrameSights& sights) const;
  std::vector<Sight> sights_of(std::size_t marker, const FrameSights& sights, const Eigen::Vector3d& place,
                               const Eigen::Vector3d& velocity) const;
  Eigen::Vector3d velocity_of(std::size_t marker) const;
  std::optional<ExpectedMarker> narrowed(const ExpectedMarker& marker, std::size_t index,
                                         const FrameSights& sights) const;
  void seek_evidence(FrameSights& sights, const std::vector<ExpectedMarker>& expected,
                     const std::vector<xray::XrayImage>& images) const;
  ContrastModel contrast_of(std::size_t marker, std::size_t view) const;
  bool may_be_noise(const MarkerImage& image, const MarkerPick& pick, const FrameSights& sights,
                    const xray::XrayImage& of) const;
  std::vector<MarkerPick> drop_weak_first(const std::vector<xray::XrayImage>& images);
  void learn_appearance(const std::vector<xray::XrayImage>& images);
  void find_first(int frame, const std::vector<xray::XrayImage>& images);
  void check_cameras() const;
  void check_rays();
  void seek_first(const std::vector<xray::XrayImage>& images);
  void warn_of_unseen();
  void check_geometry() const;
  void update_delay(std::size_t marker, const FrameSights& sights, const Eigen::Vector3d& place,
                    const Eigen::Vector3d& velocity);

  const TrackCase* given_;
  std::vector<geometry::View> cameras_;
  std::vector<MarkerAppearance> appearance_;  // per view
  std::vector<ContrastLearner> contrasts_;    // per view
  std::vector<MarkerState> markers_;
  std::vector<BodyState> bodies_;
  std::vector<std::optional<std::size_t>> body_of_;  // of each marker
  std::vector<Delay> delays_;                        // per view
  FrameSights first_;
  std::vector<Warning> warnings_;
};

}  // namespace helicarm::track

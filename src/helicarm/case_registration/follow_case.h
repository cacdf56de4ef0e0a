// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::case_registration {

/// Frames of a sequence: first, first + step, ... up to last.
struct FrameRange {
  int first = 1, last = 1, step = 1;

  int count() const { return (last - first) / step + 1; }
  std::vector<int> numbers() const {
    std::vector<int> all;
    for (int i = 0; i < count(); ++i) all.push_back(first + i * step);
    return all;
  }
};

/// Reads A-B or A-B:STEP. Fails with bad_value: numbers from 0 to 999999, A at most B, STEP at least 1.
Expected<FrameRange> frame_range_from(const std::string& text);

/// The models' poses in one frame, in the order of the case.
struct RegisteredFrame {
  int frame = 0;
  std::vector<registration::Registration> models;
};

/// A model and who follows it; the follower refers to the model.
struct FollowedModel;

/// Follows a case's models through images of views that stay where they are.
class CaseFollower {
 public:
  /// `first`: the case with the images of the first frame, which calibrate the views. Fails as `load_views`
  /// and `load_model`; a model of landmarks alone is bad_value.
  static Expected<CaseFollower> begin(const pipeline::Case& first, const RegisterOptions& options,
                                      const Progress& progress = {});
  CaseFollower(CaseFollower&&) noexcept;
  ~CaseFollower();

  /// Registers the models to the images of one frame, one for each view; the first from the models' starts,
  /// the others from where the models were. Refusals are in the result. Fails as `with_images`.
  Expected<RegisteredFrame> next(int frame, const std::vector<xray::XrayImage>& images);

  /// Goes on from a frame of an earlier run, as if `next` had given it.
  void take(const RegisteredFrame& frame);

  /// A text that two followers share only if they register the same images alike: cameras, covariance, maps,
  /// models, starts and plans, all by what their files hold.
  std::string identity() const;
  const std::vector<Warning>& warnings() const { return warnings_; }
  /// Of each model, mm, in its own coordinates.
  std::vector<Eigen::Vector3d> centres() const;

 private:
  CaseFollower() = default;
  std::optional<double> max_error_mm_;
  LoadedViews loaded_;
  std::vector<std::unique_ptr<FollowedModel>> models_;
  std::vector<Warning> warnings_;
  bool is_begun_ = false;
};

/// A model that is refused in some frame: the first one's reason, its message the number of frames.
std::optional<Failure> refusal_of(const std::vector<RegisteredFrame>& frames);

/// registration.csv: frame, model, decision, world_from_model, sigmas, code (docs/formats.md).
std::string poses_header();
std::string poses_rows(const RegisteredFrame& frame);

}  // namespace helicarm::case_registration

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/start_poses.h"

#include <fmt/format.h>

#include "helicarm/case_registration/landmark_picks.h"
#include "helicarm/case_registration/model_box.h"
#include "helicarm/case_registration/plan_errors.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;
using registration::RegistrationView;

/// What the located landmarks share: the cameras' errors and the model's motion.
Eigen::MatrixXd shared_covariance(const LoadedViews& loaded, double motion_sigma_mm) {
  const auto n = calibration::view_parameters * Eigen::Index(loaded.views.size());
  return registration::cameras_with_motion(loaded.camera_covariance.size() > 0
                                               ? loaded.camera_covariance
                                               : Eigen::MatrixXd(Eigen::MatrixXd::Zero(n, n)),
                                           motion_sigma_mm);
}

}  // namespace

StartPoses start_poses(const pipeline::Case& the_case, const LoadedViews& loaded,
                       const pipeline::CaseModel& case_model, const std::vector<RegistrationView>& views,
                       double motion_sigma_mm) {
  if (case_model.world_from_model) return {{*case_model.world_from_model}, {}, {}};
  if (!source_of_landmarks(case_model).empty()) {
    StartPoses start;
    start.used = picked_landmarks(case_model, the_case, loaded, views);
    start.landmarks = value_or_throw(
        registration::register_landmarks(start.used, shared_covariance(loaded, motion_sigma_mm)));
    start.poses = {start.landmarks->world_from_model};
    return start;
  }
  if (views.size() < 2)
    throw BadInput(
        Reason::bad_value,
        fmt::format("models: \"{}\": \"start\" is missing: with one view a pose or landmarks are needed",
                    case_model.name));
  return {};
}

void compare_with_landmarks(const StartPoses& start, const std::optional<registration::LandmarkFault>& fault,
                            registration::Registration& result) {
  if (!start.landmarks) return;
  const auto add = [&](Failure finding, bool refuses) {
    finding.message = fmt::format("{}: {}", result.name, finding.message);
    add_finding(result, std::move(finding), refuses);
  };
  if (fault) add(fault->failure, false);
  if (const auto apart = registration::contradiction(start.used, *start.landmarks, result.world_from_model,
                                                     result.covariance, result.centre))
    add(apart->failure, apart->is_certain);
}

std::vector<Warning> places_outside(const pipeline::CaseModel& case_model,
                                    const std::optional<registration::Model>& model,
                                    const std::vector<registration::Landmark>& landmarks,
                                    const std::optional<MarkupPlan>& plan) {
  std::vector<PlacedPoint> of_landmarks, of_plan;
  for (const registration::Landmark& landmark : landmarks)
    of_landmarks.push_back({landmark.name, landmark.in_model});
  if (plan)
    for (const PlanPoint& point : plan->points) of_plan.push_back({point.name, point.in_model});
  const ModelBox box = model ? box_of(*model) : box_of(landmarks);
  std::vector<Warning> warnings;
  if (const std::string given = source_of_landmarks(case_model); !given.empty())
    warnings = check_places(case_model.name, given, box, of_landmarks);
  if (case_model.plan) {
    const auto further = check_places(case_model.name, case_model.plan->filename().string(), box, of_plan);
    warnings.insert(warnings.end(), further.begin(), further.end());
  }
  return warnings;
}

registration::RegistrationOptions search_options(const RegisterOptions& options, const Progress& progress,
                                                 const LoadedViews& loaded,
                                                 const pipeline::CaseModel& case_model) {
  registration::RegistrationOptions how;
  how.max_error_mm = options.run.max_error_mm;
  how.motion_sigma_mm = options.run.motion_sigma_mm;
  how.scale_sigma = case_model.scale_sigma.value_or(registration::usual_scale_sigma);
  how.threads = options.run.threads;
  how.camera_covariance = loaded.camera_covariance;
  how.search.shift_mm = options.search.shift_mm;
  how.search.turn_deg = options.search.turn_deg;
  how.search.interrupt = progress.interrupt;
  how.search.share = progress.share;
  return how;
}

}  // namespace helicarm::case_registration

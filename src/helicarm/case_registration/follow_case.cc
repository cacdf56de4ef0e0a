// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/follow_case.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <regex>
#include <span>

#include <fmt/format.h>

#include "helicarm/case_registration/case_plans.h"
#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/case_registration/start_poses.h"
#include "helicarm/core/csv.h"
#include "helicarm/registration/follow.h"
#include "helicarm/xray/digest.h"

namespace helicarm::case_registration {

struct FollowedModel {
  registration::Model model;
  std::optional<registration::Follower> follower;
  StartPoses start;
  std::optional<registration::LandmarkFault> fault;
  std::optional<MarkupPlan> plan;
};

namespace {

using registration::Registration;

std::vector<std::unique_ptr<FollowedModel>> followed_models(const pipeline::Case& the_case,
                                                            const RegisterOptions& options,
                                                            const Progress& progress,
                                                            const LoadedViews& loaded,
                                                            std::vector<Warning>& warnings) {
  std::vector<std::unique_ptr<FollowedModel>> bodies;
  std::vector<std::optional<MarkupPlan>> plans = read_plans(the_case);
  for (std::size_t i = 0; i < the_case.models.size(); ++i) {
    const pipeline::CaseModel& case_model = the_case.models[i];
    auto model = value_or_throw(load_model(case_model)).model;
    if (!model)
      throw BadInput(Reason::bad_value,
                     fmt::format("models: \"{}\": a sequence needs a volume or a surface", case_model.name));
    StartPoses start = start_poses(the_case, loaded, case_model, loaded.views, options.run.motion_sigma_mm);
    std::optional<registration::LandmarkFault> fault;
    if (start.landmarks) fault = registration::landmark_fault(start.used, *start.landmarks);
    if (fault && fault->is_certain) throw BadInput(fault->failure);
    for (Warning& warning : places_outside(case_model, model, start.used, plans[i]))
      warnings.push_back(std::move(warning));
    auto body = std::make_unique<FollowedModel>(
        FollowedModel{std::move(*model), {}, std::move(start), fault, std::move(plans[i])});
    const std::vector<geometry::RigidTransform>& poses = body->start.poses;
    body->follower.emplace(body->model, poses, search_options(options, progress, loaded, case_model));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

/// Of the planned points in the world.
std::optional<PlannedError> largest_error(const std::optional<MarkupPlan>& plan, const Registration& result) {
  if (!plan || !result.is_determined()) return std::nullopt;
  std::vector<RegisteredPoint> points;
  for (const PlanPoint& point : plan->points) {
    points.push_back({point.name, {}});
    points.back().place.covariance_in_calibrator =
        registration::point_covariance(result, result.world_from_model * point.in_model);
  }
  return case_registration::largest_error(points);
}

/// To the last bit.
template <class Matrix>
std::string numbers_of(const Matrix& matrix) {
  std::string text;
  for (const double value : matrix.reshaped()) text += fmt::format(" {}", value);
  return text;
}

template <class Value>
std::string digest_of(std::span<const Value> values) {
  return xray::digest({reinterpret_cast<const char*>(values.data()), values.size_bytes()});
}

/// Of the model, its start and its plan.
std::string identity_of(const FollowedModel& body) {
  std::string text = body.model.name + numbers_of(body.model.centre);
  text += numbers_of(body.model.density.model_from_voxel.matrix());
  text += digest_of<float>(body.model.density.values);
  if (body.model.surface) text += digest_of<Eigen::Vector3d>(body.model.surface->mesh.corners);
  for (const geometry::RigidTransform& pose : body.start.poses) text += numbers_of(pose.matrix());
  for (const registration::Landmark& landmark : body.start.used)
    text += landmark.name + numbers_of(landmark.in_model) + numbers_of(landmark.in_world) +
            numbers_of(landmark.covariance_in_world);
  if (body.plan)
    for (const PlanPoint& point : body.plan->points) text += point.name + numbers_of(point.in_model);
  return text;
}

constexpr double degrees = 180 / EIGEN_PI;

/// 16 numbers of the pose by rows, then sigmas: three in degrees, three in mm.
std::string pose_fields(const geometry::RigidTransform& pose,
                        const registration::RigidCovariance& covariance) {
  std::string fields;
  const Eigen::Matrix4d matrix = pose.matrix();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) fields += fmt::format(",{:.9g}", matrix(row, column));
  for (int i = 0; i < 6; ++i)
    fields += covariance.allFinite()
                  ? fmt::format(",{:.6g}", (i < 3 ? degrees : 1) * std::sqrt(covariance(i, i)))
                  : ",";
  return fields;
}

/// Of the failure, or else of the warnings.
std::string code_field(const Registration& result) {
  if (result.failure) return std::string(code(result.failure->reason));
  std::string codes;
  for (const Warning& warning : result.warnings)
    codes += fmt::format("{}{}", codes.empty() ? "" : " ", code(warning.reason));
  return codes;
}

}  // namespace

Expected<FrameRange> frame_range_from(const std::string& text) {
  static const std::regex form(R"((\d+)-(\d+)(?::(\d+))?)");
  std::smatch match;
  if (!std::regex_match(text, match, form))
    return fail(Reason::bad_value,
                fmt::format("frames: \"{}\" is neither A-B nor A-B:STEP, such as 1-100 or 1-100:2", text));
  constexpr std::ptrdiff_t most_digits = 6;
  constexpr int most = 999999;
  if (std::max({match.length(1), match.length(2), match.length(3)}) > most_digits)
    return fail(Reason::bad_value, fmt::format("frames: \"{}\": a number is over the limit, {}", text, most));
  const FrameRange range{std::stoi(match[1]), std::stoi(match[2]),
                         match[3].matched ? std::stoi(match[3]) : 1};
  if (range.first > range.last || range.step < 1)
    return fail(Reason::bad_value,
                fmt::format("frames: \"{}\": the first frame must not be after the last, and the step at "
                            "least 1",
                            text));
  return range;
}

std::optional<Failure> refusal_of(const std::vector<RegisteredFrame>& frames) {
  std::optional<Failure> first;
  int refused = 0, number = 0;
  for (const RegisteredFrame& frame : frames)
    for (const Registration& model : frame.models)
      if (model.failure && refused++ == 0) first = model.failure, number = frame.frame;
  if (first)
    first->message = fmt::format("{} of {} registrations are refused, the first in frame {}: {}", refused,
                                 frames.size() * frames.front().models.size(), number, first->message);
  return first;
}

CaseFollower::CaseFollower(CaseFollower&&) noexcept = default;
CaseFollower::~CaseFollower() = default;

Expected<CaseFollower> CaseFollower::begin(const pipeline::Case& first, const RegisterOptions& options,
                                           const Progress& progress) {
  return guarded([&] {
    CaseFollower made;
    made.max_error_mm_ = options.run.max_error_mm;
    made.loaded_ = value_or_throw(load_views(first, options.run, progress.of_views()));
    made.warnings_ = first.warnings;
    // The polarity of a run is not that of its first image.
    std::ranges::copy_if(
        made.loaded_.warnings, std::back_inserter(made.warnings_), [&](const Warning& warning) {
          return std::ranges::find(made.loaded_.inverted, warning) == made.loaded_.inverted.end();
        });
    made.models_ = followed_models(first, options, progress, made.loaded_, made.warnings_);
    for (const auto& body : made.models_)
      made.warnings_.insert(made.warnings_.end(), body->model.warnings.begin(), body->model.warnings.end());
    return made;
  });
}

Expected<RegisteredFrame> CaseFollower::next(int frame, const std::vector<xray::XrayImage>& images) {
  return guarded([&] {
    const auto views = value_or_throw(with_images(loaded_, images));
    RegisteredFrame made{frame, {}};
    for (const auto& body : models_) {
      made.models.push_back(body->follower->next(views, frame));
      if (!is_begun_) compare_with_landmarks(body->start, body->fault, made.models.back());
      limit_error(largest_error(body->plan, made.models.back()), max_error_mm_, made.models.back());
      // For the figures of a report of one image.
      for (registration::RegisteredView& view : made.models.back().views) view.agreements = {};
    }
    is_begun_ = true;
    return made;
  });
}

void CaseFollower::take(const RegisteredFrame& frame) {
  for (std::size_t i = 0; i < models_.size(); ++i) models_[i]->follower->take(frame.models[i], frame.frame);
  is_begun_ = true;
}

std::string CaseFollower::identity() const {
  std::string text;
  for (std::size_t i = 0; i < loaded_.views.size(); ++i) {
    const registration::RegistrationView& view = loaded_.views[i];
    text += "\n" + view.name + numbers_of(view.view.projection());
    text += digest_of(view.usable.pixels());
    if (loaded_.maps[i]) text += rectification::to_json(*loaded_.maps[i]).dump();
  }
  text += numbers_of(loaded_.camera_covariance);
  for (const auto& body : models_) text += "\n" + identity_of(*body);
  return text;
}

std::vector<Eigen::Vector3d> CaseFollower::centres() const {
  std::vector<Eigen::Vector3d> centres;
  for (const auto& body : models_) centres.push_back(body->model.centre);
  return centres;
}

std::string poses_header() {
  std::string line = "frame,model,decision";
  for (int i = 0; i < 16; ++i) line += fmt::format(",m{}{}", i / 4 + 1, i % 4 + 1);
  return line + ",sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,sigma_x_mm,sigma_y_mm,sigma_z_mm,code\n";
}

std::string poses_rows(const RegisteredFrame& frame) {
  std::string rows;
  for (const Registration& model : frame.models)
    rows +=
        fmt::format("{},{},{}{},{}\n", frame.frame, csv_field(model.name), registration::word(model.decision),
                    pose_fields(model.world_from_model, model.covariance), code_field(model));
  return rows;
}

}  // namespace helicarm::case_registration

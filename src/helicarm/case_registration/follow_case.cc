// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/follow_case.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <regex>

#include <fmt/format.h>

#include "helicarm/case_registration/case_plans.h"
#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/case_registration/start_poses.h"
#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/registration/follow.h"

namespace helicarm::case_registration {
namespace {

using registration::Follower;
using registration::Registration;

/// Refuses images of later frames that are missing, and frames that a file does not have, before the work.
void check_frames(const pipeline::RegistrationCase& given, const FrameRange& range) {
  std::string first;
  int missing = 0;
  for (int i = 0; i < range.count(); ++i)
    for (const pipeline::CaseView& view :
         value_or_throw(pipeline::at_frame(given, range.first + i * range.step)).base.views)
      if (!std::filesystem::exists(view.image) && missing++ == 0) first = view.image.filename().string();
  if (missing > 0)
    throw BadInput(Reason::missing_file, fmt::format("{} of {} images do not exist, the first: {}", missing,
                                                     range.count() * int(given.base.views.size()), first));
  const auto last = value_or_throw(pipeline::at_frame(given, range.first + (range.count() - 1) * range.step));
  for (const pipeline::CaseView& view : last.base.views) value_or_throw(pipeline::image_of(view));
}

/// A model and who follows it; the follower refers to the model.
struct Followed {
  registration::Model model;
  std::optional<Follower> follower;
  StartPoses start;
  std::optional<registration::LandmarkFault> fault;
  std::optional<Plan> plan;
};

std::vector<std::unique_ptr<Followed>> followed_models(const pipeline::RegistrationCase& given,
                                                       const RegisterOptions& options,
                                                       const Progress& progress, const LoadedViews& loaded,
                                                       std::vector<Warning>& warnings) {
  std::vector<std::unique_ptr<Followed>> bodies;
  std::vector<std::optional<Plan>> plans = read_plans(given);
  for (std::size_t i = 0; i < given.models.size(); ++i) {
    const pipeline::CaseModel& asked = given.models[i];
    auto model = value_or_throw(load_model(asked)).model;
    if (!model)
      throw BadInput(Reason::bad_value,
                     fmt::format("models: \"{}\": a sequence needs a volume or a surface", asked.name));
    StartPoses start = start_poses(given, loaded, asked, model, loaded.views, options.run.motion_sigma_mm);
    std::optional<registration::LandmarkFault> fault;
    if (start.landmarks) fault = registration::landmark_fault(start.used, *start.landmarks);
    if (fault && fault->is_certain) throw BadInput(fault->failure);
    for (Warning& warning : places_outside(asked, model, start.used, plans[i]))
      warnings.push_back(std::move(warning));
    auto body = std::make_unique<Followed>(
        Followed{std::move(*model), {}, std::move(start), fault, std::move(plans[i])});
    const std::vector<geometry::RigidTransform>& poses = body->start.poses;
    body->follower.emplace(body->model, poses,
                           search_options(options, progress, loaded, asked, poses.size()));
    bodies.push_back(std::move(body));
  }
  return bodies;
}

/// Of the planned points in the world.
std::optional<PlannedError> largest_error(const std::optional<Plan>& plan, const Registration& result) {
  if (!plan || !result.is_determined()) return std::nullopt;
  std::vector<RegisteredPoint> points;
  for (const PlanPoint& point : plan->points) {
    points.push_back({point.name, {}});
    points.back().place.covariance_in_calibrator =
        registration::point_covariance(result, result.world_from_model * point.in_model);
  }
  return case_registration::largest_error(points);
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

std::string header(const char* first) {
  std::string line = first;
  for (int i = 0; i < 16; ++i) line += fmt::format(",m{}{}", i / 4 + 1, i % 4 + 1);
  return line + ",sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,sigma_x_mm,sigma_y_mm,sigma_z_mm,code\n";
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
  static const std::regex form(R"((\d{1,6})-(\d{1,6})(?::(\d{1,6}))?)");
  std::smatch match;
  if (!std::regex_match(text, match, form))
    return fail(Reason::bad_value,
                fmt::format("frames: \"{}\" is neither A-B nor A-B:STEP, such as 1-100 or 1-100:2", text));
  const FrameRange range{std::stoi(match[1]), std::stoi(match[2]),
                         match[3].matched ? std::stoi(match[3]) : 1};
  if (range.first > range.last || range.step < 1)
    return fail(Reason::bad_value,
                fmt::format("frames: \"{}\": the first frame must not be after the last, and the step at "
                            "least 1",
                            text));
  return range;
}

std::optional<Failure> CaseSequence::refusal() const {
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

Expected<CaseSequence> follow_case(const pipeline::RegistrationCase& given, const FrameRange& range,
                                   const RegisterOptions& options,
                                   const std::function<void(double share)>& on_frame,
                                   const Progress& progress) {
  return guarded([&] {
    CaseSequence sequence;
    sequence.warnings = given.base.warnings;
    const auto first = value_or_throw(pipeline::at_frame(given, range.first));
    const auto loaded = load_views(first, options.run, progress.of_views());
    if (!loaded) {
      if (exit_code(loaded.error().reason) == 2) throw BadInput(loaded.error());
      sequence.failure = loaded.error();
      return sequence;
    }
    sequence.warnings.insert(sequence.warnings.end(), loaded->warnings.begin(), loaded->warnings.end());
    check_frames(given, range);
    const auto bodies = followed_models(first, options, progress, *loaded, sequence.warnings);
    const auto begun = std::chrono::steady_clock::now();
    for (int i = 0; i < range.count(); ++i) {
      const int frame = range.first + i * range.step;
      const auto views =
          value_or_throw(with_images(*loaded, value_or_throw(pipeline::at_frame(given, frame))));
      RegisteredFrame made{frame, {}};
      for (const auto& body : bodies) {
        made.models.push_back(body->follower->next(views, frame));
        if (i == 0) compare_with_landmarks(body->start, body->fault, made.models.back());
        limit_error(largest_error(body->plan, made.models.back()), options.run.max_error_mm,
                    made.models.back());
        // For the figures of a report, which a sequence has not.
        for (registration::RegisteredView& view : made.models.back().views) view.agreements = {};
      }
      sequence.frames.push_back(std::move(made));
      if (on_frame) on_frame(double(i + 1) / range.count());
    }
    for (const auto& body : bodies)
      sequence.warnings.insert(sequence.warnings.end(), body->model.warnings.begin(),
                               body->model.warnings.end());
    sequence.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return sequence;
  });
}

std::string poses_csv(const CaseSequence& sequence) {
  std::string csv = header("frame,model,decision");
  for (const RegisteredFrame& frame : sequence.frames)
    for (const Registration& model : frame.models)
      csv += fmt::format("{},{},{}{},{}\n", frame.frame, csv_field(model.name),
                         registration::word(model.decision),
                         pose_fields(model.world_from_model, model.covariance), code_field(model));
  return csv;
}

std::string relative_csv(const CaseSequence& sequence) {
  std::string csv = header("frame,model,reference,decision");
  for (const RegisteredFrame& frame : sequence.frames)
    for (std::size_t i = 1; i < frame.models.size(); ++i) {
      const Registration &reference = frame.models[0], &model = frame.models[i];
      const auto relative = registration::relative_pose(reference, model);
      const bool by_reference = reference.decision > model.decision;
      csv += fmt::format("{},{},{},{}{},{}\n", frame.frame, csv_field(model.name), csv_field(reference.name),
                         registration::word(std::max(reference.decision, model.decision)),
                         pose_fields(relative.reference_from_model, relative.covariance),
                         code_field(by_reference ? reference : model));
    }
  return csv;
}

Expected<void> write_sequence(const CaseSequence& sequence, const std::filesystem::path& folder) {
  return write_file(folder / "registration.csv", poses_csv(sequence)).and_then([&]() -> Expected<void> {
    if (sequence.frames.empty() || sequence.frames.front().models.size() < 2) return {};
    return write_file(folder / "relative.csv", relative_csv(sequence));
  });
}

}  // namespace helicarm::case_registration

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <string_view>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/output.h"
#include "helicarm/guidance/bone_check_description.h"
#include "helicarm/pipeline/result_description.h"

namespace helicarm::case_registration {
namespace {

using output::if_set;
using pipeline::describe_failures;
using pipeline::describe_verdict;
using registration::Registration;

template <class Output>
void describe_point(Output& output, const RegisteredPoint& point, const std::vector<guidance::Bone>& bones) {
  output.value("name", point.name, "in the plan");
  output.value("xyz_mm", point.place.in_calibrator, "");
  output.value("covariance_mm2", point.place.covariance_in_calibrator, "");
  output.value(
      "error_95_mm", [&] { return localization::length_at_95(point.place.covariance_in_calibrator); },
      "length that 95 % of errors do not exceed");
  pipeline::describe_in_frames(output, &point.place, bones);
}

template <class Output>
void describe_view(Output& output, const registration::RegisteredView& view) {
  output.value("name", view.name, "");
  output.value("residual_px", view.residual_px, "rms of the shifts that parts of the image still require");
  output.value("held_out_mm", view.held_out_mm, "against the other views");
  output.value("score", view.score, "agreement, at most 1");
  output.value("comparisons", view.comparisons, "number of parts that were compared");
}

struct LandmarkResidual {
  std::string name;
  double residual_mm = 0;
};

std::vector<LandmarkResidual> residuals_of(const RegisteredModel& model) {
  std::vector<LandmarkResidual> residuals;
  for (std::size_t i = 0; i < model.used_landmarks.size(); ++i)
    residuals.push_back({model.used_landmarks[i].name, model.landmarks->residuals_mm[i]});
  return residuals;
}

template <class Output>
void describe_landmarks(Output& output, const RegisteredModel& model) {
  output.value(
      "fre_mm", [&] { return model.landmarks->fre_mm; }, "rms of the residuals");
  output.value(
      "fle_mm", [&] { return model.landmarks->fle_mm; }, "of a landmark, by the residuals");
  output.value(
      "tre_at_centre_mm",
      [&] { return registration::predicted_tre_mm(*model.landmarks, model.registration.centre); },
      "predicted at `centre_mm`");
  output.list(
      "landmarks", [&] { return residuals_of(model); }, "those used",
      [](auto& row, const LandmarkResidual& landmark) {
        row.value("name", landmark.name, "");
        row.value("residual_mm", landmark.residual_mm, "");
      });
}

/// How the pose was found, and how sure it is.
template <class Output>
void describe_search(Output& output, const Registration& found) {
  output.object("starts", true, "", [&](auto& row) {
    row.value("n", found.starts, "starts refined");
    row.value("agree", found.agree, "of these ended here");
  });
  output.object("runner_up", found.runner_up.has_value(), "the best other pose", [&](auto& row) {
    row.value(
        "distance_mm", [&] { return found.runner_up->distance_mm; }, "rms over the model");
    row.value(
        "cost_ratio", [&] { return found.runner_up->cost_ratio; }, "1 is as good");
  });
  static constexpr std::array<std::string_view, 2> where{"start", "anywhere"};
  output.word(
      "searched", [&] { return where[found.anywhere ? 1 : 0]; }, where,
      "about the starts, or every orientation and position: without a start, or after a refusal");
  output.list(
      "alternatives", found.alternatives,
      "at most two other poses, those of the finest levels first; a refused model's are drawn in report.html",
      [](auto& row, const registration::Alternative& other) {
        row.value(
            "world_from_model", [&] { return other.world_from_model.matrix(); }, "mm");
        row.value("distance_mm", other.distance_mm, "rms over the model");
        row.value("cost_ratio", other.cost_ratio, "as of `runner_up`");
      });
  output.value("score", found.score, "mean of the views' scores");
  output.value("spacing_mm", found.spacing_mm, "of the finest comparison in the model");
  output.value(
      "mirrored_cost_ratio", found.mirrored_ratio,
      "as of `runner_up`, of the model's mirror image; `null` for a surface that is its own mirror image");
  output.value(
      "scale_sigma", found.scale_sigma,
      "relative standard deviation of the model's size, as stated or 0.005; part of `covariance` and of the "
      "points'");
  output.value(
      "by_scale", [&] { return found.is_determined() ? std::optional(found.by_scale) : std::nullopt; },
      "how the pose errs, as a step of `covariance`, where the model is smaller than the body by "
      "`scale_sigma`: "
      "its part of `covariance`, which a point's own error by the size partly cancels");
  output.object("strain", true, "relative change of size along one direction that would fit best",
                [&](auto& row) {
                  row.value("value", found.deformation.strain, "");
                  row.value("sigma", found.deformation.sigma, "");
                });
  output.object("disagreement", found.disagreement.has_value(),
                "of the views' own solutions; `null` for one view", [&](auto& row) {
                  row.value(
                      "distance_mm", [&] { return found.disagreement->distance_mm; }, "");
                  row.value(
                      "sigma_mm", [&] { return found.disagreement->sigma_mm; }, "");
                  row.value(
                      "chi2", [&] { return found.disagreement->chi2; }, "");
                  row.value(
                      "dof", [&] { return found.disagreement->dof; }, "");
                });
}

/// A tunnel of the model's plan and its comparison with the bone.
struct CheckedTunnel {
  guidance::Tunnel tunnel;
  std::optional<registration::BoneCheck> bone_check;
};

std::vector<CheckedTunnel> tunnels_of(const RegisteredModel& model) {
  std::vector<CheckedTunnel> tunnels;
  for (std::size_t i = 0; i < model.tunnels.size(); ++i)
    tunnels.push_back({model.tunnels[i], i < model.bone_checks.size() ? model.bone_checks[i] : std::nullopt});
  return tunnels;
}

std::vector<Json> measures_json(const RegisteredModel& model) {
  std::vector<Json> list;
  for (const measures::InBone& measure : model.measures) list.push_back(measures::to_json(measure));
  return list;
}

struct PoseAtView {
  std::string view;
  geometry::RigidTransform world_from_model;
};

/// `RegisteredModel::views` have a tracked bone where it was at the first acquisition.
std::vector<PoseAtView> poses_at_views(const RegisteredModel& model,
                                       const std::vector<registration::RegistrationView>& views) {
  std::vector<PoseAtView> poses;
  for (std::size_t i = 0; i < std::min(model.views.size(), views.size()); ++i) {
    geometry::RigidTransform motion;
    if (model.moves_with)
      motion = views[i].view.camera_from_world.inverse() * model.views[i].camera_from_world;
    poses.push_back({views[i].name, motion * model.registration.world_from_model});
  }
  return poses;
}

template <class Output>
void describe_model(Output& output, const RegisteredModel& model, const CaseRegistration& result) {
  const Registration& found = model.registration;
  output.value("name", found.name, "");
  describe_verdict(output, found.failure);
  output.word(
      "decision", [&] { return registration::word(found.decision); }, registration::decision_words, "");
  describe_failures(output, "warnings", found.warnings, "");
  describe_failures(output, "notes", found.notes, "");
  output.value(
      "world_from_model", [&] { return found.world_from_model.matrix(); },
      "mm; of a model that moves with a tracked bone, at the first view's acquisition");
  output.value(
      "covariance", [&] { return found.is_determined() ? std::optional(found.covariance) : std::nullopt; },
      "of a rotation vector (rad), then a translation (mm), both in world axes, about `centre_mm`: a "
      "point p moves "
      "by `w x (p - centre) + t`. `null` where the images do not determine the pose (refused)");
  output.value("centre_mm", found.centre, "of the model, in the world");
  output.list(
      "acquisitions", [&] { return poses_at_views(model, result.loaded.views); },
      "where the model was in each view: a tracked bone moves between them",
      [](auto& row, const PoseAtView& at) {
        row.value("view", at.view, "");
        row.value(
            "world_from_model", [&] { return at.world_from_model.matrix(); }, "at its acquisition, mm");
      });
  output.value(
      "moves_with", [&] { return model.world_from_bone ? model.moves_with : std::nullopt; },
      "the bone whose marker was read at every acquisition; else `null`");
  output.value("bone_from_model",
               if_set(model.world_from_bone,
                      [&](const geometry::RigidTransform& bone) -> Eigen::Matrix4d {
                        return (bone.inverse() * found.world_from_model).matrix();
                      }),
               "the model in that bone's marker, mm: where it is in images of another moment");
  describe_search(output, found);
  output.object("landmarks", model.landmarks.has_value(), "`null` if there are none",
                [&](auto& row) { describe_landmarks(row, model); });
  output.list("views", found.views, "",
              [](auto& row, const registration::RegisteredView& view) { describe_view(row, view); });
  output.list("points", model.points, "of the plan",
              [&](auto& row, const RegisteredPoint& point) { describe_point(row, point, result.bones); });
  output.list(
      "tunnels", [&] { return tunnels_of(model); }, "as in [result.json](#resultjson)",
      [](auto& row, const CheckedTunnel& planned) {
        pipeline::describe_tunnel(row, planned.tunnel);
        row.object_of(
            "bone_check", planned.bone_check, "[the tunnel against the bone](#bone_check), see below",
            [](auto& check, const registration::BoneCheck& of) { guidance::describe_bone_check(check, of); });
      });
  output.value(
      "measures", [&] { return measures_json(model); },
      "of the model's table of landmarks, each as `helicarm measure --landmarks` prints it, see "
      "[measures](#measures-in-a-bone)");
  output.value("seconds", found.seconds, "wall-clock time");
}

template <class Output>
void describe_registration(Output& output, const CaseRegistration& result) {
  output.value("format", "helicarm-registration/1", "");
  describe_verdict(output, result.failure, result.refused());
  describe_failures(output, "warnings", result.warnings, "of the views");
  output.list("views", result.loaded.views, "their overlays are NAME_overlay.png",
              [](auto& row, const registration::RegistrationView& view) {
                row.value("name", view.name, "");
                row.value(
                    "camera_from_world", [&] { return view.view.camera_from_world.matrix(); },
                    "pose of its camera, mm");
              });
  output.list("models", result.models, "see below",
              [&](auto& row, const RegisteredModel& model) { describe_model(row, model, result); });
  output.value("version", HELICARM_VERSION, "of the program");
}

}  // namespace

Json to_json(const CaseRegistration& result) {
  return output_of([&](OutputJson& output) { describe_registration(output, result); });
}

Json registration_schema() {
  return output_schema("registration.json",
                       [](OutputSchema& output) { describe_registration(output, CaseRegistration()); });
}

}  // namespace helicarm::case_registration

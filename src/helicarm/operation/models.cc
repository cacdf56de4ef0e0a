// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/models.h"

#include <algorithm>
#include <regex>

#include <fmt/format.h>

#include "helicarm/case_registration/carry_plan.h"
#include "helicarm/case_registration/case_plans.h"
#include "helicarm/case_registration/models_at_starts.h"
#include "helicarm/case_registration/plan_errors.h"
#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/localization/error_bound.h"
#include "helicarm/operation/tool_line.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/xray/digest.h"

namespace helicarm::operation {
namespace {

namespace fs = std::filesystem;
using case_registration::CaseRegistration;

constexpr std::uintmax_t most_model_bytes = std::uintmax_t{1} << 31;

pipeline::Case with_models_of(const OperationPlan& plan, const pipeline::Case& the_case) {
  pipeline::Case with_models = the_case;
  with_models.models = plan.models;
  for (const OperationTunnel& tunnel : plan.tunnels)
    if (tunnel.of_model) with_models.model_tunnels.push_back(*tunnel.of_model);
  return with_models;
}

/// The file of voxels that a header names beside itself (MetaImage, NRRD), or the other file of a NIfTI pair;
/// nothing: in the file itself.
std::optional<fs::path> data_beside(const fs::path& header) {
  const std::string kind = header.extension().string();
  if (const auto other = value_or_throw(volume::other_of_pair(header))) return other;
  if (kind != ".mhd" && kind != ".nhdr") return std::nullopt;
  static const std::regex names(R"((?:^|\n)\s*(?:ElementDataFile\s*=|data ?file:)\s*([^\r\n]*[^\s]))");
  const std::string text = value_or_throw(read_file(header, std::uintmax_t{1} << 24));
  std::smatch found;
  if (!std::regex_search(text, found, names)) return std::nullopt;
  const std::string name = found[1];
  if (name == "LOCAL") return std::nullopt;
  if (name.starts_with("LIST"))
    throw BadInput(
        Reason::unsupported,
        fmt::format("{}: lists several data files: save the volume as one file (.nrrd, .mha) for an "
                    "operation",
                    header.filename().string()));
  return value_or_throw(path_inside(header.parent_path(), name));
}

class ModelFolder {
 public:
  explicit ModelFolder(fs::path folder) : folder_(std::move(folder)) {
    value_or_throw(make_private_folder(folder_));
  }

  /// The copy of a file, with the data that it names, or of a folder of files.
  fs::path kept(const fs::path& file, const std::string& into) {
    std::error_code ec;
    if (!fs::is_directory(file, ec)) {
      if (const auto data = data_beside(file)) copy(*data, into);
      return copy(file, into);
    }
    const std::string name = into + "/" + file.filename().string();
    for (const auto& entry : fs::directory_iterator(file, ec))
      if (entry.is_regular_file()) copy(entry.path(), name);
    return folder_ / name;
  }

  Digests files;

 private:
  fs::path copy(const fs::path& file, const std::string& into) {
    const std::string name = into + "/" + file.filename().string();
    const std::string bytes = value_or_throw(read_file(file, most_model_bytes));
    if (const auto [kept, is_new] = files.emplace(name, xray::digest(bytes)); is_new) {
      value_or_throw(make_private_folder((folder_ / name).parent_path()));
      value_or_throw(write_private_file(folder_ / name, bytes));
    } else if (kept->second != xray::digest(bytes)) {
      throw BadInput(Reason::name_clash, fmt::format("{}: two files of a model have this name", name));
    }
    return folder_ / name;
  }

  fs::path folder_;
};

guidance::LineError error_of(const guidance::PointInFrames& located, const guidance::Bone& bone,
                             const pipeline::Result& result, const pipeline::Case& the_case,
                             const guidance::ToolLine& line) {
  guidance::PlannedPoint planned{located.in_calibrator, {}};
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    // Where the bone was at this view's acquisition, as a pick would show it.
    const auto calibrator_from_bone = guidance::calibrator_from(bone, the_case.views[i].poses);
    const guidance::Place* in_bone = located.in(bone);
    planned.uv.push_back(calibrator_from_bone && in_bone
                             ? std::optional(result.views[i].calibrated.value().view.project(
                                   *calibrator_from_bone * in_bone->point()))
                             : std::nullopt);
  }
  return value_or_throw(guidance::distance_to_line(pipeline::views_of_bone(result, bone), planned, line));
}

/// Of a tunnel's end in the tool's frame.
double error_95_mm(const guidance::PropagatedPoint& end, const guidance::TrackerNoise& noise,
                   const TrackedTool& tool) {
  return localization::length_at_95(at_tip(end.point, end.total_covariance(noise), tool).covariance);
}

/// With the error that each cause alone would give. A tunnel is located by the X-ray images, or by the
/// registration of its model to them.
Failure too_uncertain(const OperationPlan& plan, const OperationTunnel& tunnel, const std::string& name,
                      guidance::PropagatedPoint end, const TrackedTool& tool) {
  const guidance::TrackerNoise noise = plan.tracker.noise();
  const TrackedTool exact{tool.marker_from_tip, tracker::PoseCovariance::Zero()};
  const double all = error_95_mm(end, noise, tool), by_images = error_95_mm(end, {}, exact);
  end.covariance.setZero();
  const double by_tracker = error_95_mm(end, noise, exact), by_tool = error_95_mm(end, {}, tool);
  return {Reason::uncertain,
          fmt::format(
              "{}: the 95 % error of \"{}\" at the tool's tip is {:.3g} mm, over the limit of {:g} mm; "
              "by the {} alone {:.3g} mm, the tracker {:.3g} mm, the {} calibration {:.3g} mm",
              tunnel.name, name, all, plan.max_error_mm, tunnel.of_model ? "registration" : "X-ray images",
              by_images, by_tracker, plan.drill ? "drill's" : "hand-eye", by_tool),
          {},
          {{"error_95_mm", all},
           {"limit_mm", plan.max_error_mm},
           {tunnel.of_model ? "registration_95_mm" : "images_95_mm", by_images},
           {"tracker_95_mm", by_tracker},
           {"tool_95_mm", by_tool}}};
}

}  // namespace

Expected<Digests> keep_models(OperationPlan& plan, const fs::path& session) {
  return guarded([&]() -> Digests {
    if (plan.models.empty()) return {};
    ModelFolder folder(session / "models");
    for (std::size_t i = 0; i < plan.models.size(); ++i) {
      pipeline::CaseModel& model = plan.models[i];
      const std::string into = std::to_string(i + 1);
      for (auto* file : {&model.volume, &model.surface, &model.mask.file, &model.tunnel_mask.file,
                         &model.landmarks, &model.plan, &model.measures, &model.zones})
        if (*file) *file = folder.kept(**file, into);
      value_or_throw(case_registration::load_model(model));
    }
    plan.folder = session;
    pipeline::Case the_case;
    the_case.picks = plan.picks;
    case_registration::read_plans(with_models_of(plan, the_case));
    return std::move(folder.files);
  });
}

Expected<CaseRegistration> register_models(const OperationPlan& plan, const pipeline::Case& the_case,
                                           const pipeline::Result& measured,
                                           const case_registration::Progress& progress,
                                           const std::vector<ModelStart>& starts) {
  return guarded([&] {
    if (!measured.calibration) throw BadInput(Reason::usage, "no measurement yet");
    pipeline::Case with_models = with_models_of(plan, the_case);
    for (const ModelStart& start : starts) {
      const auto model = std::ranges::find(with_models.models, start.model, &pipeline::CaseModel::name);
      if (model == with_models.models.end())
        throw BadInput(Reason::bad_value, fmt::format("{}: is not a model of the plan", start.model));
      model->world_from_model = start.world_from_model;
    }
    return value_or_throw(case_registration::register_loaded(
        with_models, case_registration::views_of_calibration(with_models, *measured.calibration),
        measuring_options(plan), progress, case_registration::located_points_of(measured)));
  });
}

Expected<CaseRegistration> models_at_starts(const OperationPlan& plan, const pipeline::Case& the_case,
                                            const pipeline::Result& measured,
                                            const case_registration::Progress& progress) {
  return guarded([&] {
    if (!measured.calibration) throw BadInput(Reason::usage, "no measurement yet");
    const pipeline::Case with_models = with_models_of(plan, the_case);
    return value_or_throw(case_registration::models_at_starts(
        with_models, case_registration::views_of_calibration(with_models, *measured.calibration), progress));
  });
}

Json recorded(const CaseRegistration& registration) {
  Json json = case_registration::to_json(registration);
  for (Json& view : json["views"]) view.erase("camera_from_world");
  for (Json& model : json["models"]) {
    model.erase("seconds");
    // Follow from other records; sessions of earlier versions lack them.
    for (const char* key : {"acquisitions", "moves_with", "bone_from_model", "by_scale"}) model.erase(key);
    for (Json& tunnel : model["tunnels"])
      if (tunnel["bone_check"].is_object())
        for (const char* key : {"end_sigma_mm", "drilled_end_sigma_mm", "least_sure"})
          tunnel["bone_check"].erase(key);
  }
  return json;
}

Expected<pipeline::Result> with_registration(const pipeline::Result& measured,
                                             const CaseRegistration& registration, const OperationPlan& plan,
                                             const pipeline::Case& the_case,
                                             const std::vector<guidance::ToolLine>& lines) {
  return guarded([&] {
    const auto plans = case_registration::read_plans(with_models_of(plan, the_case));
    CaseRegistration now;
    now.models = registration.models;
    for (std::size_t i = 0; i < now.models.size(); ++i) {
      case_registration::RegisteredModel& model = now.models[i];
      if (!plans[i] || model.registration.failure || !model.registration.is_determined()) continue;
      carry_plan(*plans[i], the_case, model);
      limit_error(case_registration::largest_error(model.points), plan.max_error_mm, model.registration);
    }
    pipeline::Result result = case_registration::with_models(measured, now);
    for (const guidance::ToolLine& line : lines) {
      const auto tunnel = std::ranges::find(plan.tunnels, line.tunnel, &OperationTunnel::name);
      if (tunnel == plan.tunnels.end()) continue;
      guidance::Verification verified{line.name, {}, {}};
      if (const auto* start = place_of(result, *tunnel, tunnel->start))
        verified.start = error_of(*start, tunnel->bone, result, the_case, line);
      if (const auto* end = place_of(result, *tunnel, tunnel->end))
        verified.end = error_of(*end, tunnel->bone, result, the_case, line);
      result.verifications.push_back(verified);
    }
    return result;
  });
}

Expected<void> check_error_at_tip(const OperationPlan& plan, const OperationTunnel& tunnel,
                                  const pipeline::Result& result, const guidance::Poses& now,
                                  const TrackedTool& tool) {
  return guarded([&] {
    const auto tracker_from_bone = now.tracker_from(tunnel.bone);
    if (!tracker_from_bone || !now.tracker_from_tool)
      throw BadInput(Reason::no_pose, "the marker of the tool or the bone is not visible");
    const auto at_tip_now = [&](const std::string& end) {
      const guidance::PointInFrames* located = place_of(result, tunnel, end);
      const guidance::Place* in_bone = located ? located->in(tunnel.bone) : nullptr;
      if (!in_bone)
        throw BadInput(Reason::not_seen, fmt::format("{}: is not located in its bone's frame", end));
      // The tracker's errors grow with the distance from the marker: with the tip where it will be.
      geometry::RigidTransform tracker_from_tool = *now.tracker_from_tool;
      tracker_from_tool.translation += *tracker_from_bone * in_bone->propagated.point -
                                       tracker_from_tool * tool.marker_from_tip.translation;
      return guidance::to_tool(in_bone->propagated, tunnel.bone, *tracker_from_bone, tracker_from_tool);
    };
    const guidance::PropagatedPoint start = at_tip_now(tunnel.start), end = at_tip_now(tunnel.end);
    const double of_start = error_95_mm(start, plan.tracker.noise(), tool);
    const double of_end = error_95_mm(end, plan.tracker.noise(), tool);
    if (of_start <= plan.max_error_mm && of_end <= plan.max_error_mm) return;
    throw BadInput(!(of_start <= of_end) ? too_uncertain(plan, tunnel, tunnel.start, start, tool)
                                         : too_uncertain(plan, tunnel, tunnel.end, end, tool));
  });
}

}  // namespace helicarm::operation

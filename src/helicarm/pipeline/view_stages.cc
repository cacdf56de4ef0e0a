// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/view_stages.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/navigation/prior.h"
#include "helicarm/rectification/usable.h"
#include "helicarm/xray/read_exposure.h"

namespace helicarm {
namespace {

constexpr double plate_share = 0.5;  // a plate's balls, should there be one, are this much smaller at most

Expected<DistortionMap> map_from(const CaseView& from, const std::optional<Plate>& plate, Method method) {
  return guarded([&] {
    if (from.map)
      return value_or_throw(
          distortion_map_from_json(value_or_throw(read_json(*from.map)), from.map->filename().string()));
    const Exposure apart = value_or_throw(read_exposure(*from.plate_image, from.name, std::nullopt));
    return value_or_throw(rectify(apart, *plate, {method, {}})).map;
  });
}

/// Mean place of the balls that serve in any view.
Eigen::Vector3d centre_of(const CalibrationResult& calibration) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (const auto& of_view : calibration.fiducials)
    for (const Fiducial& ball : of_view)
      if (ball.status == FiducialStatus::used) {
        sum += ball.centre_in_calibrator;
        ++count;
      }
  return sum / count;
}

ViewFiducials fiducials_of(const ViewResult& view) {
  const DistortionMap& map = view.rectification->map;
  std::vector<Eigen::Vector2d> used;
  for (const Fiducial& ball : view.found->fiducials)
    if (ball.status == FiducialStatus::used) used.push_back(ball.uv);
  return {view.name, view.found->fiducials, intrinsics_prior(*view.exposure, map), view.found->view,
          map.covariance_px2(used)};
}

}  // namespace

Expected<std::vector<Warning>> check_pictures_belong_together(const std::vector<ViewResult>& views) {
  std::vector<Warning> warnings;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Acquisition& a = views[j].exposure->acquisition;
      const Acquisition& b = views[i].exposure->acquisition;
      if (!a.patient_key.empty() && !b.patient_key.empty() && a.patient_key != b.patient_key)
        return fail(Reason::patient_mismatch, fmt::format("{} and {} are of different patients or studies",
                                                          views[j].name, views[i].name));
      if (!a.instance_key.empty() && a.instance_key == b.instance_key)
        return check_usable(*views[i].exposure).and_then([&]() -> Expected<std::vector<Warning>> {
          return fail(Reason::views_too_close,
                      fmt::format("{} and {} are the same picture", views[j].name, views[i].name));
        });
      if (!a.uid_key.empty() && a.uid_key == b.uid_key)
        warnings.push_back({Reason::uid_reused,
                            fmt::format("{} and {} differ, but bear the same SOP Instance UID (0008,0018)",
                                        views[j].name, views[i].name)});
    }
  return warnings;
}

Expected<Rectification> rectify_view(const Exposure& exposure, const CaseView& from,
                                     const std::optional<Plate>& plate, const Calibrator& calibrator,
                                     Method method) {
  if (from.map || from.plate_image)
    return map_from(from, plate, method).and_then([&](const DistortionMap& map) {
      return with_map(exposure, map, plate);
    });
  if (plate) return rectify(exposure, *plate, {method, {}});
  const auto& pixel = exposure.acquisition.pixel_mm;
  return without_plate(exposure, pixel ? plate_share * ball_radii_px(calibrator, pixel->mean()).low : 0);
}

Expected<std::optional<FoundFiducials>> find_unless_ambiguous(const ViewResult& view,
                                                              const Calibrator& calibrator, Method method) {
  const Rectification& plate = *view.rectification;
  const auto ambiguous = [](const auto& found) {
    return !found && found.error().reason == Reason::ambiguous_labels;
  };
  auto found = find_fiducials(*view.exposure, plate, calibrator, method);
  if (found) return std::optional(std::move(*found));
  if (ambiguous(found)) return std::optional<FoundFiducials>();
  // The plate's kind tells how metal shows: were it the other kind, the calibrator might be seen.
  if (plate.dots_found > 0) {
    const auto inverted = with_metal_inverted(*view.exposure, plate);
    const auto other = find_fiducials(*view.exposure, inverted, calibrator, method);
    if (other || ambiguous(other))
      return fail(
          Reason::plate_mismatch,
          "the calibrator is seen if the plate's dots are taken for holes instead of balls or for balls "
          "instead of holes");
  }
  return tl::unexpected<Failure>(found.error());
}

std::optional<double> common_radius_bias(const std::vector<ViewResult>& views) {
  const FoundFiducials* surest = nullptr;
  for (const ViewResult& view : views)
    if (view.found && (!surest || view.found->margin > surest->margin)) surest = &*view.found;
  return surest ? std::optional(surest->radius_bias) : std::nullopt;
}

Expected<CalibrationResult> calibrate_views(const std::vector<ViewResult>& views,
                                            const Calibrator& calibrator, Method method,
                                            const std::optional<MachineKnowledge>& machine) {
  std::vector<ViewFiducials> fiducials;
  for (const ViewResult& view : views) fiducials.push_back(fiducials_of(view));
  CalibrationOptions options;
  options.common = {unknown_machine(), calibrator.tolerance_mm};
  if (machine) {
    options.common.machine = machine->prior;
    for (std::size_t i = 0; i < views.size(); ++i)
      fiducials[i].prior = known_prior(fiducials[i].prior, *machine, views[i].found->mirrored);
  }
  return (method == Method::paper ? calibrate_paper(fiducials, options) : calibrate(fiducials, options))
      .and_then([](CalibrationResult calibration) -> Expected<CalibrationResult> {
        if (auto apart = check_views_apart(calibration.views, centre_of(calibration)); !apart)
          return tl::unexpected<Failure>(apart.error());
        return calibration;
      });
}

Expected<MachineKnowledge> recall_machine(const std::vector<ViewResult>& views, const Machine& machine) {
  const IntrinsicsPrior nominal = fiducials_of(views.front()).prior;
  for (const ViewResult& view : views)
    if (!fiducials_of(view).prior.focal_px)
      return fail(Reason::bad_value,
                  "a machine's history serves only pictures whose pixel size and source distance are known",
                  {});
  std::vector<MachineShot> earlier;
  std::ranges::copy_if(machine.shots, std::back_inserter(earlier), [&](const MachineShot& shot) {
    return std::ranges::none_of(views, [&](const ViewResult& view) {
      return view.exposure->acquisition.instance_key == shot.picture;
    });
  });
  return knowledge_of(earlier, {*nominal.focal_px / nominal.unit_px, 0, 0}, unknown_machine());
}

std::vector<MachineShot> lessons_of(const std::vector<ViewResult>& views, const Calibrator& calibrator) {
  std::vector<MachineShot> shots;
  for (const ViewResult& view : views)
    if (const auto shot = shot_of(fiducials_of(view), view.exposure->acquisition.instance_key,
                                  {unknown_machine(), calibrator.tolerance_mm}))
      shots.push_back(*shot);
  return shots;
}

void keep_calibration(const CalibrationResult& calibration, Result& result) {
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    result.views[i].calibrated = calibration.views[i];
    result.views[i].found->fiducials = calibration.fiducials[i];
  }
  result.joint_covariance = calibration.joint_covariance;
  result.warnings.insert(result.warnings.end(), calibration.warnings.begin(), calibration.warnings.end());
}

void gather_warnings(Result& result) {
  for (const ViewResult& view : result.views) {
    const auto gather = [&](const std::vector<Warning>& warnings) {
      for (Warning warning : warnings) {
        if (warning.view.empty()) warning.view = view.name;
        result.warnings.push_back(std::move(warning));
      }
    };
    if (view.exposure) gather(view.exposure->warnings);
    if (view.rectification) gather(view.rectification->warnings);
    if (view.found) gather(view.found->warnings);
  }
}

}  // namespace helicarm

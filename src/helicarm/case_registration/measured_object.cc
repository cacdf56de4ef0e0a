// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/measured_object.h"

#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace helicarm::case_registration {
namespace {

struct NamedObject {
  std::string whole_name;  ///< "MODEL: NAME" of a planned point
  report::SpacingObject object;
  std::optional<guidance::Bone> moves_with;
};

std::optional<guidance::Bone> bone_of(const Measurement& measured, const std::string& model) {
  if (measured.registration)
    for (const RegisteredModel& each : measured.registration->models)
      if (each.registration.name == model) return each.moves_with;
  return std::nullopt;
}

std::vector<NamedObject> objects_of(const Measurement& measured) {
  std::vector<NamedObject> all;
  const auto add = [&](std::string whole_name, const std::string& name, const guidance::PointInFrames& at,
                       const std::optional<guidance::Bone>& moves_with) {
    all.push_back({std::move(whole_name), {name, at.in_calibrator, at.covariance_in_calibrator}, moves_with});
  };
  for (const pipeline::PointResult& point : measured.result.points)
    if (point.place) add(point.name, point.name, *point.place, point.moves_with);
  for (const pipeline::ModelPoint& point : measured.result.model_points)
    add(fmt::format("{}: {}", point.model, point.name), point.name, point.place,
        bone_of(measured, point.model));
  if (!measured.registration) return all;
  for (const RegisteredModel& model : measured.registration->models) {
    const registration::Registration& found = model.registration;
    if (!found.failure && found.is_determined())
      all.push_back({found.name,
                     {found.name, found.centre, found.covariance.bottomRightCorner<3, 3>()},
                     model.moves_with});
  }
  return all;
}

/// Empty unless the bone was seen at every acquisition.
std::vector<geometry::RigidTransform> motions_of(const std::vector<guidance::Poses>& acquisitions,
                                                 const std::optional<guidance::Bone>& bone) {
  std::vector<geometry::RigidTransform> motions;
  if (!bone) return motions;
  for (const guidance::Poses& poses : acquisitions) {
    const auto calibrator_from_bone = guidance::calibrator_from(*bone, poses);
    if (!calibrator_from_bone) return {};
    motions.push_back(*calibrator_from_bone *
                      guidance::calibrator_from(*bone, acquisitions.front())->inverse());
  }
  return motions;
}

}  // namespace

Expected<report::SpacingObject> object_named(const Measurement& measured, const std::string& name) {
  return guarded([&] {
    const std::vector<NamedObject> all = objects_of(measured);
    std::vector<report::SpacingObject> found;
    std::vector<std::string> names;
    for (const NamedObject& one : all) {
      if (one.whole_name == name || one.object.name == name) {
        found.push_back(one.object);
        found.back().motions = motions_of(measured.poses, one.moves_with);
      }
      names.push_back(one.whole_name);
    }
    if (found.size() > 1)
      throw BadInput(Reason::name_clash, fmt::format("\"{}\" is the name of {} objects: {}", name,
                                                     found.size(), fmt::join(names, ", ")));
    if (found.empty())
      throw BadInput(Reason::bad_value,
                     fmt::format("no located point, planned point or registered model \"{}\"; there are: {}",
                                 name, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
    return found.front();
  });
}

}  // namespace helicarm::case_registration

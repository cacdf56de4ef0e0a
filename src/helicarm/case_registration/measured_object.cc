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
};

std::vector<NamedObject> objects_of(const Measurement& measured) {
  std::vector<NamedObject> all;
  const auto add = [&](std::string whole_name, const std::string& name, const guidance::PointInFrames& at) {
    all.push_back({std::move(whole_name), {name, at.in_calibrator, at.covariance_in_calibrator}});
  };
  for (const pipeline::PointResult& point : measured.result.points)
    if (point.place) add(point.name, point.name, *point.place);
  for (const pipeline::ModelPoint& point : measured.result.model_points)
    add(fmt::format("{}: {}", point.model, point.name), point.name, point.place);
  if (!measured.registration) return all;
  for (const RegisteredModel& model : measured.registration->models) {
    const registration::Registration& found = model.registration;
    if (!found.failure && found.is_determined())
      all.push_back({found.name, {found.name, found.centre, found.covariance.bottomRightCorner<3, 3>()}});
  }
  return all;
}

}  // namespace

Expected<report::SpacingObject> object_named(const Measurement& measured, const std::string& name) {
  return guarded([&] {
    const std::vector<NamedObject> all = objects_of(measured);
    std::vector<report::SpacingObject> found;
    std::vector<std::string> names;
    for (const NamedObject& one : all) {
      if (one.whole_name == name || one.object.name == name) found.push_back(one.object);
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

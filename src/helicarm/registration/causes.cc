// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/causes.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "helicarm/registration/metal_over_model.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using geometry::RigidTransform;

// Of the model's samples. What an image does not show counts as half a disagreement: beyond a third the rest
// must agree by a quarter more than a whole model.
constexpr double least_outside_share = 1.0 / 3;

/// Share of the model's samples beyond the image or in the black surround of its field.
double outside_share(const Model& model, const RegistrationView& view,
                     const RigidTransform& world_from_model) {
  RegistrationView with_fiducials = view;
  with_fiducials.usable = {};
  const image::Image<std::uint8_t> field = attenuation_raster(with_fiducials).valid;
  const auto is_outside = [&](const Vector3d& sample) {
    const Vector3d at = world_from_model * sample;
    if (!(view.view.depth(at) > 1)) return true;
    const Vector2d pixel = view.view.project(at).array().round();
    if (pixel.minCoeff() < 0 || pixel.x() >= field.width() || pixel.y() >= field.height()) return true;
    return field(int(pixel.x()), int(pixel.y())) == 0;
  };
  return double(std::ranges::count_if(model.samples, is_outside)) / double(model.samples.size());
}

std::optional<Warning> cropped_field(const Model& model, const RegistrationView& view,
                                     const RigidTransform& world_from_model) {
  const double share = outside_share(model, view, world_from_model);
  if (share < least_outside_share) return std::nullopt;
  return Warning{
      Reason::wrong_model,
      fmt::format("{}: at the pose found {:.0f} % of the model lies outside the field of {} (stated from "
                  "{:.0f} % on): if the pose is right, take an image that shows more of it, or mask the part "
                  "that the images show",
                  model.name, 100 * share, view.name, 100 * least_outside_share),
      view.name,
      {{"outside_share", share}, {"limit", least_outside_share}}};
}

std::optional<Warning> metal(const Model& model, const RegistrationView& view,
                             const RegisteredView& registered, const Registration& found) {
  const auto seen = metal_over_model(model, view, registered, found);
  if (!seen) return std::nullopt;
  return Warning{
      Reason::wrong_model,
      fmt::format(
          "{}: at the pose found {} shows metal over the model, {:.0f} mm long, {:.0f} mm2 within its "
          "outline ({:.1f} times the contrast of the model's densest parts); {:.0f} % of the "
          "comparisons lie on it or beside it (agreement {:.2f}, elsewhere {:.2f}): take an image "
          "without the instrument, or from where an implant covers less of the bone",
          model.name, view.name, seen->length_mm, seen->area_mm2, seen->contrast,
          100 * seen->comparisons_share, seen->agreement, seen->agreement_elsewhere),
      view.name,
      {{"metal_mm", seen->length_mm},
       {"metal_mm2", seen->area_mm2},
       {"contrast", seen->contrast},
       {"comparisons_share", seen->comparisons_share},
       {"agreement", seen->agreement},
       {"agreement_elsewhere", seen->agreement_elsewhere}}};
}

Warning broken(const Model& model, const BrokenBone& bone) {
  return {
      Reason::wrong_model,
      fmt::format("{}: its parts on both sides of ({:.0f}, {:.0f}, {:.0f}), {:.0f} mm from its end at "
                  "({:.0f}, {:.0f}, {:.0f}), are each registered alone, {:.1f} mm and {:.0f} degrees "
                  "apart: the bone is broken there or has been moved since the CT{}; register its parts as "
                  "models of their own, each with a mask of that part",
                  model.name, bone.cut.x(), bone.cut.y(), bone.cut.z(), bone.from_end_mm, bone.end.x(),
                  bone.end.y(), bone.end.z(), bone.moved_mm, bone.turned_deg,
                  model.outlined ? "" : ", or the model, which has no mask, is of two bones"),
      {},
      {{"x_mm", bone.cut.x()},
       {"y_mm", bone.cut.y()},
       {"z_mm", bone.cut.z()},
       {"from_end_mm", bone.from_end_mm},
       {"moved_mm", bone.moved_mm},
       {"turned_deg", bone.turned_deg}}};
}

}  // namespace

std::vector<Warning> causes_of(const Model& model, const std::vector<RegistrationView>& views,
                               const Registration& refused, const RegisterPart& register_part) {
  std::vector<Warning> notes;
  if (!refused.failure) return notes;
  for (std::size_t i = 0; i < views.size() && i < refused.views.size(); ++i) {
    if (auto note = cropped_field(model, views[i], refused.world_from_model))
      notes.push_back(*std::move(note));
    if (auto note = metal(model, views[i], refused.views[i], refused)) notes.push_back(*std::move(note));
  }
  if (register_part)
    if (const auto bone = broken_bone(model, views, refused, register_part))
      notes.push_back(broken(model, *bone));
  return notes;
}

}  // namespace helicarm::registration

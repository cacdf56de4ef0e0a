// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/causes.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "helicarm/registration/metal_over_model.h"
#include "helicarm/registration/unexplained_part.h"

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

std::string place(const Vector3d& point) {
  return fmt::format("({:.0f}, {:.0f}, {:.0f})", point.x(), point.y(), point.z());
}

Warning broken(const Model& model, const BrokenBone& bone) {
  return {
      Reason::wrong_model,
      fmt::format(
          "{}: its parts on both sides of {}, {:.0f} mm from its end at {}, are each registered alone, "
          "{:.1f} mm and {:.0f} degrees apart: the bone is broken there or has been moved since the CT{}; "
          "register its parts as models of their own, each with a mask of that part",
          model.name, place(bone.cut), bone.from_end_mm, place(bone.end), bone.moved_mm, bone.turned_deg,
          model.outlined ? "" : ", or the model, which has no mask, is of two bones"),
      {},
      {{"x_mm", bone.cut.x()},
       {"y_mm", bone.cut.y()},
       {"z_mm", bone.cut.z()},
       {"from_end_mm", bone.from_end_mm},
       {"moved_mm", bone.moved_mm},
       {"turned_deg", bone.turned_deg}}};
}

/// What the views show of an unexplained part, and for which points the pose holds.
std::string unexplained(const Model& model, const std::vector<RegistrationView>& views,
                        const UnexplainedPart& part) {
  std::string agreements;
  for (std::size_t i = 0; i < part.agreements.size(); ++i)
    agreements += fmt::format("{}{} {:.2f}, elsewhere {:.2f}", i == 0 ? "" : "; ", views[i].name,
                              part.agreements[i], part.agreements_elsewhere[i]);
  return fmt::format(
      "{}: the part about {}, beyond {}, is not explained by the pose found (agreement in {}): the bone is "
      "broken there or has been moved since the CT{}, or that part is hidden. Pose and error hold for the "
      "rest alone, about {}, not for points planned in that part; register the parts as models of their "
      "own, each with a mask of that part",
      model.name, place(part.centre), place(part.section), agreements,
      model.outlined ? "" : ", or the model, which has no mask, is of two bones", place(part.centre_of_rest));
}

std::string alone(const PartAlone& part) {
  return fmt::format("; alone it agrees by {:.2f} at a pose {:.1f} mm and {:.0f} degrees from there{}",
                     part.agreement, part.moved_mm, part.turned_deg,
                     part.refused ? fmt::format(", where it is refused ({})", code(*part.refused)) : "");
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

void warn_of_part_not_explained(const Model& model, const std::vector<RegistrationView>& views,
                                const RegisterPart& register_part, Registration& registered) {
  if (registered.failure) return;
  const auto part = unexplained_part(model, views, registered, register_part);
  if (!part) return;
  const Vector3d& cut = part->section;
  Warning warning{Reason::wrong_model,
                  unexplained(model, views, *part),
                  {},
                  {{"x_mm", cut.x()},
                   {"y_mm", cut.y()},
                   {"z_mm", cut.z()},
                   {"agreement", part->agreement},
                   {"agreement_elsewhere", part->agreement_elsewhere}}};
  if (part->alone) {
    warning.message += alone(*part->alone);
    warning.figures["agreement_alone"] = part->alone->agreement;
    warning.figures["moved_mm"] = part->alone->moved_mm;
    warning.figures["turned_deg"] = part->alone->turned_deg;
  }
  for (std::size_t i = 0; i < views.size() && i < registered.views.size(); ++i)
    if (const auto seen = metal_over_model(model, views[i], registered.views[i], registered))
      warning.message +=
          fmt::format("; {} shows metal over the model, {:.0f} mm long, which may hide the part",
                      views[i].name, seen->length_mm);
  registered.warnings.push_back(std::move(warning));
  registered.decision = Decision::warn;
  registered.not_explained = {part->cut.middle(), (part->is_upper ? 1 : -1) * part->cut.axis.direction};
}

bool is_of_part_not_explained(const Warning& warning) {
  return warning.reason == Reason::wrong_model && warning.figures.contains("agreement_elsewhere");
}

}  // namespace helicarm::registration

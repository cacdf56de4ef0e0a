// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/view_of.h"

#include <algorithm>
#include <numbers>

#include <Eigen/Core>

namespace helicarm::xray {
namespace {

constexpr double in_degrees = 180 / std::numbers::pi;
/// Tolerance of a view's angle: a leg is seldom aligned with the beam.
constexpr double plain_deg = 30;

enum class Kind { frontal, lateral, other };

Kind kind_of(const std::string& view) {
  if (view == "AP" || view == "PA") return Kind::frontal;
  return view.starts_with("LAT") ? Kind::lateral : Kind::other;
}

/// Positioner angles; PS3.3 C.8.7.5: primary about the patient's long axis, secondary towards the head.
std::optional<Eigen::Vector3d> beam(const Acquisition& shown) {
  if (!shown.primary_angle_deg) return std::nullopt;
  const double primary = *shown.primary_angle_deg / in_degrees;
  const double secondary = shown.secondary_angle_deg.value_or(0) / in_degrees;
  return Eigen::Vector3d(std::cos(primary) * std::cos(secondary), std::sin(primary) * std::cos(secondary),
                         std::sin(secondary));
}

Kind kind_of(const Eigen::Vector3d& beam) {
  const double plain = std::cos(plain_deg / in_degrees);
  if (std::abs(beam.x()) > plain) return Kind::frontal;
  return std::abs(beam.y()) > plain ? Kind::lateral : Kind::other;
}

}  // namespace

std::string view_of(const Acquisition& shown, const std::string& wanted, std::span<const std::string> views) {
  const auto direction = beam(shown);
  const Kind kind = direction ? kind_of(*direction) : Kind::other;
  if (kind == Kind::other || kind_of(wanted) == Kind::other || kind_of(wanted) == kind) return wanted;
  const auto better = std::ranges::find(views, kind, [](const std::string& view) { return kind_of(view); });
  return better == views.end() ? wanted : *better;
}

std::optional<std::string> kind_of_view(const Acquisition& shown) {
  const auto direction = beam(shown);
  const Kind kind = direction ? kind_of(*direction) : Kind::other;
  if (kind == Kind::other) return std::nullopt;
  return kind == Kind::frontal ? "AP" : "LAT";
}

std::optional<double> degrees_apart(const Acquisition& a, const Acquisition& b) {
  const auto one = beam(a), other = beam(b);
  if (!one || !other || *one == *other) return std::nullopt;
  return in_degrees * std::acos(std::min(1.0, std::abs(one->dot(*other))));
}

}  // namespace helicarm::xray

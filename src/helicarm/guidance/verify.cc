// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/verify.h"

#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"

namespace helicarm::guidance {
namespace {

constexpr double least_depth_mm = 1;
constexpr double least_image_length_px = 1;

double squared(double x) { return x * x; }

double distance_in_space(const Eigen::Vector3d& point, const ToolLine& line) {
  const Eigen::Vector3d axis = (line.p2_in_calibrator - line.p1_in_calibrator).normalized();
  return axis.cross(point - line.p1_in_calibrator).norm();
}

}  // namespace

double TipDepth::error_95_mm() const { return normal_at_975 * sigma_mm; }

std::string words_of(const TipDepth& depth) {
  return fmt::format("{:.2f} mm {} the planned end (95 % error {:.2g} mm)", std::abs(depth.beyond_end_mm),
                     depth.beyond_end_mm < 0 ? "before" : "beyond", depth.error_95_mm());
}

std::optional<Failure> TipDepth::why_off(const std::string& tunnel) const {
  const double off_mm = std::abs(beyond_end_mm) - tolerance_mm;
  if (off_mm <= 0 && error_95_mm() <= tolerance_mm) return std::nullopt;
  const bool is_off = off_mm > 0;
  const std::string verdict =
      is_off ? fmt::format("the tunnel {} {}", off_mm > error_95_mm() ? "is" : "may be",
                           beyond_end_mm > 0 ? "deeper than planned"
                                             : "shorter than planned, or the drill is not at its bottom")
             : "whether its depth is within the tolerance is not known";
  return Failure{
      is_off ? Reason::off_target : Reason::uncertain,
      fmt::format("tunnel \"{}\": the drill's tip is {}, tolerance {:g} mm: {}", tunnel, words_of(*this),
                  tolerance_mm, verdict),
      {},
      {{"beyond_end_mm", beyond_end_mm}, {"error_95_mm", error_95_mm()}, {"tolerance_mm", tolerance_mm}}};
}

Eigen::Vector2d foot_on_line(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = (b - a).normalized();
  return a + along * along.dot(point - a);
}

Expected<LineError> distance_to_line(const std::vector<geometry::View>& views, const PlannedPoint& point,
                                     const ToolLine& line) {
  LineError error;
  error.distance_mm = distance_in_space(point.point_in_calibrator, line);
  double sum_px = 0;
  double sum_mm = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    error.per_view_px.emplace_back();
    if (!point.uv[i]) continue;
    const geometry::View& view = views[i];
    if (view.depth(line.p1_in_calibrator) < least_depth_mm ||
        view.depth(line.p2_in_calibrator) < least_depth_mm)
      return fail(Reason::behind_source,
                  fmt::format("tool line \"{}\" reaches behind the source", line.name));
    const Eigen::Vector2d a = view.project(line.p1_in_calibrator);  // Eq. 6
    const Eigen::Vector2d b = view.project(line.p2_in_calibrator);
    if ((b - a).norm() < least_image_length_px) continue;
    const Eigen::Vector2d off = foot_on_line(*point.uv[i], a, b) - *point.uv[i];
    const double depth = view.depth(point.point_in_calibrator);
    const Eigen::Vector2d off_mm{depth * off.x() / view.intrinsics.fx, depth * off.y() / view.intrinsics.fy};
    error.per_view_px.back() = off.norm();
    sum_px += squared(off.norm());
    sum_mm += squared(off_mm.norm());
  }
  error.combined_px = std::sqrt(sum_px);  // Eq. 17
  error.combined_mm = std::sqrt(sum_mm);
  return error;
}

}  // namespace helicarm::guidance

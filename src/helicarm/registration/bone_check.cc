// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/bone_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include <Eigen/Geometry>

#include "helicarm/registration/bone_surface.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using guidance::NoEntry;

constexpr double step_mm = 0.5;
constexpr int sectors = 72;
constexpr double reach_mm = 60;    // of the wall's surroundings
constexpr double beyond_mm = 300;  // the line is followed behind its ends
constexpr double open_start_mm = 5, open_end_mm = 1;
constexpr double axis_part_mm = 10;  // of the axis, whose nearest place is kept in each direction
constexpr double least_ahead_cosine = 0.5;
constexpr double interruption_mm = 1.5;  // of an opening's face, by steps of a mask
const double one_face_cosine = std::cos(30 * std::numbers::pi / 180);  // within the section
const double same_face_cosine = std::cos(60 * std::numbers::pi / 180);
const double least_slope_sine = std::sin(2 * std::numbers::pi / 180);
constexpr double deg = 180 / std::numbers::pi;

struct Frame {
  Vector3d axis, across, up;

  Vector3d spoke(int sector, int of = sectors) const {
    const double angle = 2 * std::numbers::pi * sector / of;
    return std::cos(angle) * across + std::sin(angle) * up;
  }
};

Frame frame_of(const Vector3d& axis) {
  const Vector3d across = axis.unitOrthogonal();
  return {axis, across, axis.cross(across)};
}

/// Surface beside the tunnel, along a spoke from its axis.
struct Beside {
  double radius_mm = 0;
  std::optional<Vector3d> normal;  ///< nothing: the axis is outside the bone there
};

/// Where the tunnel crosses the surface.
struct Opening {
  double at_mm;     ///< along the line from its start
  Vector3d normal;  ///< outward, of the face
};

class Check {
 public:
  Check(const BoneSurface& bone, const BoneTunnel& tunnel)
      : bone_(bone),
        start_(tunnel.start),
        length_((tunnel.end - tunnel.start).norm()),
        frame_(frame_of((tunnel.end - tunnel.start) / length_)),
        diameter_(tunnel.diameter_mm) {}

  /// Nothing: the start is too deep in the bone to open.
  std::optional<BoneCheck> made() {
    BoneCheck check;
    check.diameter_mm = diameter_;
    if (!find_openings()) return std::nullopt;
    const double to = exit_ ? exit_->at_mm : length_;
    const bool is_cut = passes_a_cut() || (entry_ && !bone_.shows(at(to)));
    if (!entry_ || is_cut) {
      if (is_cut) check.no_entry = NoEntry::beyond_ct;
      return check;
    }
    check.entry = at(entry_->at_mm);
    check.end = at(to);
    check.length_in_bone_mm = length_in_bone(to);
    check.entry_angle_deg = angle_deg(*entry_);
    if (exit_) check.exit = check.end, check.exit_angle_deg = angle_deg(*exit_);
    if (diameter_) measure_wall(to, check);
    if (diameter_ && !exit_) measure_end(to, check);
    return check;
  }

 private:
  Vector3d at(double along) const { return start_ + along * frame_.axis; }
  double radius() const { return diameter_.value_or(0) / 2; }
  double angle_deg(const Opening& opening) const {
    return std::asin(std::min(1.0, std::abs(opening.normal.dot(frame_.axis)))) * deg;
  }

  /// Bone of the line that the CT does not show, or bone at its start without a surface behind it.
  bool passes_a_cut() const {
    if (bone_.holds(start_) && !(entry_ && entry_->at_mm < 0)) return true;
    for (double along = 0; along < length_; along += step_mm)
      if (bone_.holds(at(along)) && !bone_.shows(at(along))) return true;
    return false;
  }

  /// False: the start is too deep in the bone to open.
  bool find_openings() {
    crossings_ = bone_.crossings(at(-beyond_mm), frame_.axis, length_ + 2 * beyond_mm);
    for (Crossing& crossing : crossings_) crossing.at_mm -= beyond_mm;
    const bool end_inside = bone_.holds(at(length_));
    std::optional<Crossing> into, out;
    for (const Crossing& crossing : crossings_) {
      if (crossing.at_mm < 0 && !crossing.leaves) into = crossing;
      if (crossing.at_mm < 0 && crossing.leaves) into.reset();
    }
    const bool start_inside = into.has_value();
    for (const Crossing& crossing : crossings_) {
      if (!into && !crossing.leaves && crossing.at_mm >= 0 && crossing.at_mm <= length_) into = crossing;
      const bool ends_it =
          end_inside ? crossing.at_mm > length_ && !out : crossing.at_mm >= 0 && crossing.at_mm <= length_;
      if (crossing.leaves && ends_it) out = crossing;
    }
    if (end_inside && out && out->at_mm > length_ + open_end_mm) out.reset();
    if (start_inside && -into->at_mm > open_start_mm) return false;
    if (!into) return true;
    entry_ = Opening{into->at_mm, face_normal(*into)};
    if (out) exit_ = Opening{out->at_mm, face_normal(*out)};
    return true;
  }

  /// Of the face that most of the tunnel's section lies on: an edge beside the opening is not averaged with
  /// it.
  Vector3d face_normal(const Crossing& middle) const {
    std::vector<Vector3d> normals{middle.normal};
    const double reach = 2 * radius() + 2;
    for (int i = 0; i < 8; ++i) {
      const Vector3d from = at(middle.at_mm - reach) + radius() * frame_.spoke(i, 8);
      for (const Crossing& crossing : bone_.crossings(from, frame_.axis, 2 * reach))
        if (crossing.leaves == middle.leaves) {
          normals.push_back(crossing.normal);
          break;
        }
    }
    const auto sum_near = [&](const Vector3d& normal) {
      Vector3d sum = Vector3d::Zero();
      for (const Vector3d& each : normals)
        if (each.dot(normal) > one_face_cosine) sum += each;
      return sum;
    };
    Vector3d most = Vector3d::Zero();
    for (const Vector3d& normal : normals)
      if (const Vector3d sum = sum_near(normal); sum.norm() > most.norm()) most = sum;
    return most.normalized();
  }

  double length_in_bone(double to) const {
    double sum = 0, from = entry_->at_mm;
    bool inside = true;
    for (const Crossing& crossing : crossings_) {
      if (crossing.at_mm <= entry_->at_mm || crossing.at_mm > to) continue;
      if (inside && crossing.leaves) sum += crossing.at_mm - from;
      inside = !crossing.leaves;
      from = crossing.at_mm;
    }
    return inside ? sum + to - from : sum;
  }

  std::optional<Beside> beside(const Vector3d& from, const Vector3d& spoke) const {
    const auto found = bone_.crossings(from, spoke, radius() + reach_mm, 1);
    if (found.empty()) return std::nullopt;
    if (!found.front().leaves) return Beside{0, std::nullopt};
    return Beside{found.front().at_mm, found.front().normal};
  }

  /// `inward`: along the axis into the bone.
  bool is_face(const std::optional<Beside>& hit, const Opening& opening, const Vector3d& inward) const {
    return hit && hit->normal && hit->normal->dot(opening.normal) > same_face_cosine &&
           -hit->normal->dot(inward) > least_slope_sine;
  }

  void measure_wall(double to, BoneCheck& check) const {
    const double from = entry_->at_mm, span = to - from;
    const int n = std::max(2, int(std::ceil(span / step_mm)));
    const auto depth = [&](int i) { return span * (i + 0.5) / n; };
    const int interruption = int(interruption_mm / (span / n));
    for (int sector = 0; sector < sectors; ++sector) {
      std::vector<std::optional<Beside>> hits;
      for (int i = 0; i < n; ++i) hits.push_back(beside(at(from + depth(i)), frame_.spoke(sector)));
      int first = 0, last = n - 1;
      for (int i = 0; i < n && i - first <= interruption; ++i)
        if (is_face(hits[std::size_t(i)], *entry_, frame_.axis)) first = i + 1;
      for (int i = n - 1; exit_ && i >= 0 && last - i <= interruption; --i)
        if (is_face(hits[std::size_t(i)], *exit_, -frame_.axis)) last = i - 1;
      std::map<int, Hit> nearest;
      for (int i = first; i <= last; ++i)
        if (const auto& hit = hits[std::size_t(i)])
          keep_nearer(nearest[int(depth(i) / axis_part_mm)],
                      {hit->radius_mm - radius(), depth(i),
                       at(from + depth(i)) + hit->radius_mm * frame_.spoke(sector),
                       hit->normal.value_or(frame_.spoke(sector))});
      for (const auto& [part, hit] : nearest) take(check, hit);
    }
  }

  /// Surface beside the wall or ahead of the end.
  struct Hit {
    double distance_mm = std::numeric_limits<double>::infinity(), at_mm = 0;
    Vector3d place = Vector3d::Zero(), outward = Vector3d::Zero();
  };

  static void keep_nearer(Hit& nearest, const Hit& hit) {
    if (hit.distance_mm < nearest.distance_mm) nearest = hit;
  }

  guidance::WallPlace place_of(const Hit& hit) const {
    const double sigma = bone_.sigma_mm(hit.place);
    return {hit.distance_mm, sigma, sigma, hit.at_mm, at(entry_->at_mm + hit.at_mm), hit.outward};
  }

  void take(BoneCheck& check, const Hit& hit) const {
    if (!std::isfinite(hit.distance_mm)) return;
    const guidance::WallPlace& place = check.wall.emplace_back(place_of(hit));
    if (check.bridge_mm && place.distance_mm >= *check.bridge_mm) return;
    check.bridge_mm = place.distance_mm;
    check.sigma_mm = check.drilled_sigma_mm = place.sigma_mm;
    check.at_mm = place.at_mm;
    check.thinnest = place.on_axis;
    check.outward = place.outward;
  }

  /// Bone ahead of a blind end, and walls that close in beyond it.
  void measure_end(double to, BoneCheck& check) const {
    constexpr int around = 12;
    for (const double share : {0.0, 0.5, 1.0})
      for (int i = 0; i < (share > 0 ? around : 1); ++i) {
        const Vector3d from = at(to) + share * radius() * frame_.spoke(i, around);
        const auto found = bone_.crossings(from, frame_.axis, reach_mm, 1);
        if (found.empty()) continue;
        const Crossing& surface = found.front();
        const double cosine = std::max(std::abs(surface.normal.dot(frame_.axis)), least_ahead_cosine);
        guidance::WallPlace& place =
            check.ahead.emplace_back(place_of({surface.leaves ? surface.at_mm : 0, to - entry_->at_mm,
                                               from + surface.at_mm * frame_.axis, surface.normal / cosine}));
        place.sigma_mm /= cosine;
        place.drilled_sigma_mm /= cosine;
        if (check.end_mm && place.distance_mm >= *check.end_mm) continue;
        check.end_mm = place.distance_mm;
        check.end_sigma_mm = check.drilled_end_sigma_mm = place.sigma_mm;
      }
    for (int sector = 0; sector < sectors; sector += 2) {
      Hit nearest;
      for (double angle = 5; angle < 90; angle += 5) {
        const Vector3d way =
            std::sin(angle / deg) * frame_.spoke(sector) + std::cos(angle / deg) * frame_.axis;
        const auto hit = beside(at(to), way);
        if (!hit || !hit->normal || hit->normal->dot(frame_.axis) > std::numbers::sqrt2 / 2) continue;
        const double across = hit->radius_mm * std::sin(angle / deg) - radius();
        if (across > 0)
          keep_nearer(nearest, {std::hypot(across, hit->radius_mm * std::cos(angle / deg)),
                                to - entry_->at_mm, at(to) + hit->radius_mm * way, *hit->normal});
      }
      take(check, nearest);
    }
  }

  const BoneSurface& bone_;
  Vector3d start_;
  double length_;
  Frame frame_;
  std::optional<double> diameter_;
  std::vector<Crossing> crossings_;
  std::optional<Opening> entry_, exit_;
};

}  // namespace

BoneCheck check_tunnel(const BoneSurface& bone, const BoneTunnel& tunnel) {
  if (auto check = Check(bone, tunnel).made()) return *std::move(check);
  // From its end, now a start at the surface.
  auto turned = Check(bone, {tunnel.end, tunnel.start, tunnel.diameter_mm}).made();
  if (turned) return *std::move(turned);
  return {.diameter_mm = tunnel.diameter_mm, .no_entry = NoEntry::opens_nowhere};
}

double tunnel_distance_mm(const BoneCheck& a, const BoneCheck& b) {
  if (!a.entry || !b.entry) return std::numeric_limits<double>::infinity();
  // Of two segments (Ericson 2004, 5.1.9).
  const Vector3d u = a.end - *a.entry, v = b.end - *b.entry, apart = *a.entry - *b.entry;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double spread = uu * vv - uv * uv;
  double s = spread > 1e-9 ? std::clamp((uv * v.dot(apart) - u.dot(apart) * vv) / spread, 0.0, 1.0) : 0;
  const double t = std::clamp(vv > 0 ? (uv * s + v.dot(apart)) / vv : 0, 0.0, 1.0);
  s = std::clamp(uu > 0 ? (t * uv - u.dot(apart)) / uu : 0, 0.0, 1.0);
  return (apart + s * u - t * v).norm() - a.diameter_mm.value_or(0) / 2 - b.diameter_mm.value_or(0) / 2;
}

}  // namespace helicarm::registration

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/bone_edge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/LU>

#include "helicarm/core/statistics.h"

namespace helicarm::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

/// Millimetres, limited to a range of voxel widths.
struct Length {
  double mm, least_voxels, most_voxels;

  double of(double voxel_mm) const { return std::clamp(mm, least_voxels * voxel_mm, most_voxels * voxel_mm); }
};

constexpr Length farthest_within{1.5, 1.6, 5};  // of the edge from the outline: grown masks, low thresholds
constexpr Length farthest_outside{0.5, 0.75, 1.7};  // high thresholds; beyond may be a bone that touches
constexpr Length cortex_reach{2.5, 2, 8}, tissue_reach{2, 2, 7};  // beyond those
constexpr Length outline_sigma{1.3, 1.4, 4};                      // of the smoothing that gives normals
constexpr double band_voxels = 1.5;
constexpr double step_voxels = 0.4;
constexpr double lowest_hu = -150, highest_hu = 3000, air_hu = -500, highest_tissue_hu = 100;
constexpr double least_contrast_hu = 100;
constexpr double turn_share = 0.25;  // of the contrast, above the CT's noise
constexpr double near_peak = 0.9;
constexpr double unresolved = 3.6;  // 2.355 of a blurred line, whose flank is 0.67 as wide as that of a step
constexpr double direct_air = 2.2;  // standard deviations of the blur, between cortex and air
constexpr double dense_share = 0.95;     // of the cortex's places
constexpr double least_dense_hu = 1200;  // a bone may have no thick cortex
constexpr double smoothing_voxels = 0.7, most_smoothing_mm = 1;
constexpr double kept_voxels = 0.4;  // of a measured distance: smoothing does not change its sign
constexpr double edge_sigma_voxels = 0.15;
constexpr double outline_edge_voxels = 0.2;  // 0.29 (uniform), less over the neighbours that are averaged
constexpr double sigma_unit_voxels = 0.02;
const double sqrt_12 = std::sqrt(12.0);

/// Values along the outline's normal, from inside to outside.
struct Profile {
  std::vector<double> values;        ///< limited
  std::vector<double> seen;          ///< not limited below
  double first_mm = 0, step_mm = 0;  ///< place of the first value from the outline, outward
  std::size_t outline = 0;

  double place(std::size_t i) const { return first_mm + step_mm * double(i); }
  /// Between the value at `i` and the one before it.
  double passed(const std::vector<double>& h, std::size_t i, double level) const {
    const double drop = h[i - 1] - h[i];
    return place(i) - (drop > 0 ? step_mm * std::clamp((level - h[i]) / drop, 0.0, 1.0) : 0);
  }
};

/// The cortex next to the outline and what lies beside it.
struct Edge {
  const Profile* profile = nullptr;
  std::size_t peak = 0, outside = 0;  ///< the first value outward of the peak below half its height
  std::size_t end = 0;                ///< of the soft tissue: where the values rise again, or the profile's
  double soft = 0, height = 0;
  double shell_mm = std::numeric_limits<double>::infinity();  ///< full width at half its height

  double cortex() const { return soft + height; }
  /// Where the flank has this value, or comes nearest to it.
  double place_of(double hu) const {
    const auto& h = profile->values;
    std::size_t i = outside;
    while (i > peak + 1 && h[i - 1] < hu) --i;
    while (i + 1 < end && h[i] > hu) ++i;
    return profile->passed(h, i, hu);
  }
  double place(double share) const { return place_of(soft + share * height); }
  /// Standard deviation of a blurred step with this flank.
  double blur_mm() const { return (place(0.25) - place(0.75)) / (2 * 0.6745); }
  /// Half the height over air that begins at the flank, of a CT of this blur.
  std::optional<double> place_over_air(double blur_mm) const {
    const auto& h = profile->seen;
    std::size_t air = outside;
    while (air < end && h[air] > air_hu) ++air;
    if (air == end || profile->passed(h, air, air_hu) - place(0.5) > direct_air * blur_mm)
      return std::nullopt;
    const double level =
        (cortex() + *std::min_element(h.begin() + std::ptrdiff_t(air), h.begin() + std::ptrdiff_t(end))) / 2;
    std::size_t i = peak + 1;
    while (h[i] > level) ++i;
    return profile->passed(h, i, level);
  }
};

std::optional<Edge> edge_of(const Profile& profile) {
  const auto& h = profile.values;
  const auto [low, high] = std::ranges::minmax(h);
  const double turn = turn_share * (high - low);
  if (high - low < least_contrast_hu) return std::nullopt;
  Edge edge{&profile, profile.outline};
  for (std::size_t i = profile.outline; i-- > 0 && h[i] > h[edge.peak] - turn;)
    if (h[i] > h[edge.peak]) edge.peak = i;
  std::size_t i = profile.outline;
  for (; i < h.size() && h[i] > h[edge.peak] - turn; ++i)
    if (h[i] > h[edge.peak]) edge.peak = i;
  const double cortex = h[edge.peak];
  edge.soft = cortex;
  for (; i < h.size() && h[i] < edge.soft + turn; ++i) edge.soft = std::min(edge.soft, h[i]);
  edge.end = i;
  edge.height = cortex - edge.soft;
  if (edge.height < least_contrast_hu) return std::nullopt;
  for (edge.outside = edge.peak; h[edge.outside] > edge.soft + edge.height / 2;) ++edge.outside;
  double within = cortex;
  for (i = edge.peak; i-- > 0 && h[i] < within + turn;) within = std::min(within, h[i]);
  if (cortex - within > turn)
    for (i = edge.peak; i-- > 0;)
      if (h[i] < (cortex + within) / 2) {
        edge.shell_mm = edge.place(0.5) - profile.place(i);
        break;
      }
  return edge;
}

/// Of the height of a shell, what remains after a blur by which it has this width. Up to `unresolved` times
/// the blur the width says nothing: the flank of a thin shell looks as that of a step of less blur.
double remaining_share(double width_mm, double blur_mm) {
  const double beyond = width_mm * width_mm - std::pow(unresolved * blur_mm, 2);
  return beyond > 0 ? std::erf(std::sqrt(beyond / 2) / blur_mm) : 0;
}

class EdgeSearch {
 public:
  EdgeSearch(const ByteGrid& bone, const std::vector<float>& hu, const Matrix3d& mm_from_voxel)
      : hu_(hu),
        mm_from_voxel_(mm_from_voxel),
        voxel_from_mm_(mm_from_voxel.inverse()),
        spacing_(mm_from_voxel.colwise().norm()),
        bone_(bone) {
    for (std::uint8_t& value : bone_.values) value = value != 0 ? 255 : 0;
    for (int axis = 0; axis < 3; ++axis)
      outline_sigma_[axis] = outline_sigma.of(spacing_[axis]) / spacing_[axis];
    outline_ = bone_;
    smooth(outline_, outline_sigma_);
  }

  BoneEdge edge() {
    estimate_scan();
    BoneEdge edge{byte_grid(bone_.size), byte_grid(bone_.size), sigma_unit_voxels * spacing_.maxCoeff()};
    std::vector<bool> is_measured(bone_.values.size());
    bone_.each([&](const Vector3i& at) { is_measured[bone_.index(at)] = measure(at, edge); });
    const ByteGrid sharp = edge.inside;
    smooth(edge.inside, (most_smoothing_mm / spacing_.array()).min(smoothing_voxels));
    // Thin plates and narrow gaps remain.
    for (std::size_t i = 0; i < is_measured.size(); ++i) {
      const double before = sharp.values[i] - 127.5, now = edge.inside.values[i] - 127.5;
      if (is_measured[i] && before * now < 0 && std::abs(before) > kept_voxels / band_voxels * 127.5)
        edge.inside.values[i] = sharp.values[i];
    }
    return edge;
  }

 private:
  struct Near {
    Vector3d normal;       // outward
    double inside_mm = 0;  // of the outline, about
    double voxel_mm = 0;   // its width along the normal, as that of an ellipsoid
  };

  /// Nothing: far from the outline.
  std::optional<Near> near(const Vector3i& at) const {
    const std::uint8_t value = outline_.values[outline_.index(at)];
    if (value == 0 || value == 255) return std::nullopt;
    const auto strides = outline_.strides();
    Vector3d rise;
    for (int axis = 0; axis < 3; ++axis) {
      const auto here = std::ptrdiff_t(outline_.index(at));
      const std::ptrdiff_t stride = strides[std::size_t(axis)];
      const bool up = at[axis] + 1 < outline_.size[axis], down = at[axis] > 0;
      rise[axis] = (double(outline_.values[std::size_t(here + (up ? stride : 0))]) -
                    double(outline_.values[std::size_t(here - (down ? stride : 0))])) /
                   std::max(1, int(up) + int(down));
    }
    const Vector3d outward = -voxel_from_mm_.transpose() * rise;
    if (outward.norm() == 0) return std::nullopt;
    Near found;
    found.normal = outward.normalized();
    const Vector3d along = mm_from_voxel_.transpose() * found.normal;
    found.voxel_mm = along.norm();
    const double share = value / 255.0;
    const double normal_quantile = std::log(share / (1 - share)) / 1.75;  // about
    found.inside_mm = along.cwiseProduct(outline_sigma_).norm() * normal_quantile;
    if (std::abs(found.inside_mm) > farthest_within.of(found.voxel_mm) + band_voxels * found.voxel_mm)
      return std::nullopt;
    return found;
  }

  /// Replaces `near.inside_mm` by the place of the voxels' own outline.
  void take_profile(const Vector3i& at, Near& near, Profile& profile) const {
    profile.step_mm = step_voxels * near.voxel_mm;
    const auto steps = [&](double mm) { return std::size_t(std::ceil(mm / profile.step_mm)); };
    const std::size_t inward = steps(farthest_within.of(near.voxel_mm) + cortex_reach.of(near.voxel_mm));
    const std::size_t outward = steps(farthest_within.of(near.voxel_mm) + tissue_reach.of(near.voxel_mm));
    const Vector3d step = voxel_from_mm_ * near.normal;
    const auto voxel = [&](std::size_t i) -> Vector3d {
      return at.cast<double>() + (near.inside_mm + profile.step_mm * (double(i) - double(inward))) * step;
    };
    profile.values.clear(), profile.seen.clear();
    double before = 0, crossing = double(inward);
    bool has_crossing = false;
    for (std::size_t i = 0; i <= inward + outward; ++i) {
      profile.seen.push_back(std::min(highest_hu, value_at(hu_, bone_.size, voxel(i))));
      profile.values.push_back(std::max(lowest_hu, profile.seen.back()));
      const double share = value_at(bone_.values, bone_.size, voxel(i)) - 127.5;
      if (i > 0 && before > 0 && share <= 0) {
        const double here = double(i) - share / (share - before);
        if (!has_crossing || std::abs(here - double(inward)) < std::abs(crossing - double(inward)))
          crossing = here;
        has_crossing = true;
      }
      before = share;
    }
    near.inside_mm += (crossing - double(inward)) * profile.step_mm;
    profile.first_mm = -crossing * profile.step_mm;
    profile.outline = std::min(profile.values.size() - 1, std::size_t(std::lround(crossing)));
  }

  double blur_mm(const Vector3d& normal) const {
    return (mm_from_voxel_.transpose() * normal)
        .cwiseQuotient(spacing_)
        .normalized()
        .cwiseProduct(blur_mm_)
        .norm();
  }

  /// Blur, dense cortex and soft tissue, from every third place on the outline.
  void estimate_scan() {
    constexpr int every = 3;
    constexpr std::size_t least_places = 20;
    constexpr double along_axis = 0.9;
    std::vector<double> cortices, tissues, blurs;
    std::array<std::vector<double>, 3> blurs_along;
    Profile profile;
    bone_.each([&](const Vector3i& at) {
      if ((at.x() + at.y() + at.z()) % every != 0) return;
      auto beside = near(at);
      if (!beside || std::abs(beside->inside_mm) > beside->voxel_mm / 2) return;
      take_profile(at, *beside, profile);
      const auto edge = edge_of(profile);
      if (!edge) return;
      cortices.push_back(edge->cortex());
      tissues.push_back(edge->soft);
      blurs.push_back(edge->blur_mm());
      const Vector3d along =
          (mm_from_voxel_.transpose() * beside->normal).cwiseQuotient(spacing_).normalized().cwiseAbs();
      for (int axis = 0; axis < 3; ++axis)
        if (along[axis] > along_axis) blurs_along[std::size_t(axis)].push_back(blurs.back());
    });
    if (cortices.empty()) return;
    dense_hu_ = std::max(dense_hu_, quantile(cortices, dense_share));
    soft_hu_ = std::min(highest_tissue_hu, median(tissues));
    for (int axis = 0; axis < 3; ++axis) {
      const auto& along = blurs_along[std::size_t(axis)];
      blur_mm_[axis] = median(along.size() < least_places ? blurs : along);
    }
  }

  /// Half the height of a cortex as dense as the bone's densest, as a share of what is seen.
  double dense_level(const Edge& edge, double blur) const {
    const double share = remaining_share(edge.shell_mm, blur);
    const double most = std::max(1.0, (dense_hu_ - edge.soft) / edge.height);
    return std::min(near_peak, 0.5 * (share * most > 1 ? 1 / share : most));
  }

  /// False: the CT shows no edge.
  bool measure(const Vector3i& at, BoneEdge& edge) {
    const std::size_t i = bone_.index(at);
    const double side = bone_.values[i] != 0 ? 1 : -1;
    double inside = side * band_voxels;
    double sigma = outline_edge_voxels * spacing_.maxCoeff();
    bool is_measured = false;
    if (auto beside = near(at)) {
      take_profile(at, *beside, profile_);
      sigma = outline_edge_voxels * beside->voxel_mm;
      if (const auto found = edge_of(profile_)) {
        is_measured = true;
        const double blur = blur_mm(beside->normal);
        const double half = found->place(0.5);
        const double inner = found->place(dense_level(*found, blur));
        const double outer =
            std::max({half, found->place_over_air(std::max(blur, 0.5 * beside->voxel_mm)).value_or(half),
                      found->soft > soft_hu_ ? found->place_of((found->cortex() + soft_hu_) / 2) : half});
        const double measured = (outer + inner) / 2;
        const double kept = std::clamp(measured, -farthest_within.of(beside->voxel_mm),
                                       farthest_outside.of(beside->voxel_mm));
        inside = (beside->inside_mm + kept) / beside->voxel_mm;
        sigma = std::hypot((outer - inner) / sqrt_12, edge_sigma_voxels * beside->voxel_mm) +
                std::abs(measured - kept);
      } else {
        // Smoothing turns an outline of this height into the distance from it.
        inside = side * 1.25 * smoothing_voxels;
      }
    }
    const double value = 127.5 * (1 + std::clamp(inside / band_voxels, -1.0, 1.0));
    edge.inside.values[i] = static_cast<std::uint8_t>(std::lround(value));
    edge.sigma.values[i] =
        static_cast<std::uint8_t>(std::clamp(std::lround(sigma / edge.sigma_unit_mm), 1L, 255L));
    return is_measured;
  }

  const std::vector<float>& hu_;
  Matrix3d mm_from_voxel_, voxel_from_mm_;
  Vector3d spacing_, outline_sigma_;  // the latter in voxels
  ByteGrid bone_, outline_;           // 0 or 255; smoothed
  Vector3d blur_mm_ = Vector3d::Zero();
  double dense_hu_ = least_dense_hu, soft_hu_ = highest_hu;
  Profile profile_;
};

}  // namespace

BoneEdge bone_edge(const ByteGrid& bone, const std::vector<float>& hu, const Matrix3d& mm_from_voxel) {
  return EdgeSearch(bone, hu, mm_from_voxel).edge();
}

Vector3i bone_edge_margin(const Matrix3d& mm_from_voxel) {
  const double widest_mm = mm_from_voxel.colwise().norm().maxCoeff();
  const double reach_mm = farthest_within.of(widest_mm) + tissue_reach.of(widest_mm);
  return (reach_mm * mm_from_voxel.inverse().rowwise().norm()).array().ceil().cast<int>() + 2;
}

}  // namespace helicarm::volume

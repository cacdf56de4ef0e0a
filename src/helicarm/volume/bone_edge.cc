// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/bone_edge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/LU>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"

namespace helicarm::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double limit_mm = 1.5, limit_voxels = 1.6;  // between outline and edge
constexpr double band_voxels = 1.5;                   // beyond that, and of the distances
constexpr double inward_mm = 2.5, outward_mm = 2;     // beyond the limit: where cortex and soft tissue are
constexpr double step_voxels = 0.4, least_step_mm = 0.1;
constexpr double least_contrast_hu = 100;
constexpr double turn_share = 0.25;  // of the contrast, by which a profile turns
constexpr double near_peak = 0.9;
constexpr double unresolved = 3.6;  // 2.355 of a blurred line, whose flank is 0.67 as wide as that of a step
constexpr double dense_share = 0.95;  // of the cortex's places
constexpr double least_dense_hu = 1200, least_tissue_hu = -150;
constexpr double outline_sigma_mm = 1.3, outline_sigma_voxels = 1.4;
constexpr double fine_sigma_voxels = 0.7, most_fine_sigma_mm = 1;
constexpr double edge_sigma_voxels = 0.15;   // of a measured edge
constexpr double outline_edge_voxels = 0.2;  // 0.29 (uniform), less over the neighbours that are averaged

/// A line through the outline: values along the normal from inside to outside.
struct Profile {
  std::vector<double> values;
  double first_mm = 0, step_mm = 0;  ///< place of the first value from the outline, outward
  std::size_t outline = 0;

  double place(std::size_t i) const { return first_mm + step_mm * double(i); }
};

/// The cortex next to the outline and the soft tissue beside it.
struct Edge {
  const Profile* profile = nullptr;
  std::size_t peak = 0, outside = 0;  ///< the first value outward of the peak below half its height
  double soft = 0, height = 0;
  double shell_mm = std::numeric_limits<double>::infinity();  ///< full width at half its height

  /// Where the flank has this share of the height.
  double place(double share) const {
    const auto& h = profile->values;
    const double level = soft + share * height;
    std::size_t i = outside;
    while (i > peak + 1 && h[i - 1] < level) --i;
    while (i + 1 < h.size() && h[i] > level) ++i;
    const double drop = h[i - 1] - h[i];
    return profile->place(i) - (drop > 0 ? profile->step_mm * (level - h[i]) / drop : 0);
  }
  /// Standard deviation of a blurred step with this flank.
  double blur_mm() const { return (place(0.25) - place(0.75)) / (2 * 0.6745); }
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

class Measurement {
 public:
  Measurement(const ByteGrid& bone, const std::vector<float>& hu, const Matrix3d& mm_from_voxel)
      : hu_(hu),
        mm_from_voxel_(mm_from_voxel),
        voxel_from_mm_(mm_from_voxel.inverse()),
        outline_(bone),
        fine_(bone) {
    const Vector3d spacing = mm_from_voxel.colwise().norm();
    outline_sigma_ = (outline_sigma_mm / spacing.array()).max(outline_sigma_voxels);
    for (ByteGrid* grid : {&outline_, &fine_})
      for (std::uint8_t& value : grid->values) value = value != 0 ? 255 : 0;
    smooth(outline_, outline_sigma_);
    fine_sigma_ = (most_fine_sigma_mm / spacing.array()).min(fine_sigma_voxels);
    smooth(fine_, fine_sigma_);
  }

  BoneEdge made(unsigned threads) {
    learn();
    BoneEdge edge{byte_grid(outline_.size), byte_grid(outline_.size)};
    parallel_for(std::size_t(outline_.size.z()), threads, [&](std::size_t z) {
      for (int y = 0; y < outline_.size.y(); ++y)
        for (int x = 0; x < outline_.size.x(); ++x) measure({x, y, int(z)}, edge);
    });
    smooth(edge.inside, fine_sigma_);
    return edge;
  }

 private:
  struct Near {
    Vector3d normal;         // outward
    double inside_mm = 0;    // of the outline
    double voxel_mm = 0;     // its width along the normal, as that of an ellipsoid
    double farthest_mm = 0;  // edge from the outline
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
    found.farthest_mm = std::max(limit_mm, limit_voxels * found.voxel_mm);
    // The normal distribution's quantile, about.
    const double share = value / 255.0;
    found.inside_mm = along.cwiseProduct(outline_sigma_).norm() * std::log(share / (1 - share)) / 1.75;
    if (std::abs(found.inside_mm) > found.farthest_mm + band_voxels * found.voxel_mm) return std::nullopt;
    return found;
  }

  Profile profile(const Vector3i& at, const Near& near) const {
    Profile made;
    made.step_mm = std::max(least_step_mm, step_voxels * near.voxel_mm);
    const double reach = near.farthest_mm;
    const auto inward = std::size_t(std::ceil((reach + inward_mm) / made.step_mm));
    const auto outward = std::size_t(std::ceil((reach + outward_mm) / made.step_mm));
    made.outline = inward;
    made.first_mm = -double(inward) * made.step_mm;
    const Vector3d step = voxel_from_mm_ * near.normal;
    for (std::size_t i = 0; i <= inward + outward; ++i)
      made.values.push_back(
          value_at(hu_, outline_.size, at.cast<double>() + (near.inside_mm + made.place(i)) * step));
    return made;
  }

  /// The CT's blur and the bone's dense cortex, from places on the outline.
  void learn() {
    std::vector<double> heights, blurs;
    outline_.each([&](const Vector3i& at) {
      constexpr int every = 3;
      if ((at.x() + at.y() + at.z()) % every != 0) return;
      const auto beside = near(at);
      if (!beside || std::abs(beside->inside_mm) > beside->voxel_mm / 2) return;
      const Profile line = profile(at, *beside);
      const auto edge = edge_of(line);
      if (!edge) return;
      heights.push_back(edge->soft + edge->height);
      blurs.push_back(edge->blur_mm());
    });
    if (heights.empty()) return;
    dense_hu_ = std::max(dense_hu_, quantile(heights, dense_share));
    blur_mm_ = median(blurs);
  }

  /// The highest level at which the edge may be, as a share of its height: of a cortex as dense as the bone's
  /// densest, and of one that was cut out of its soft tissue.
  double highest_level(const Edge& edge) const {
    const double share = remaining_share(edge.shell_mm, blur_mm_);
    const double most = std::max(1.0, (dense_hu_ - edge.soft) / edge.height);
    const double dense = 0.5 * (share * most > 1 ? 1 / share : most);
    const double cut_out = 0.5 * (1 + std::max(0.0, least_tissue_hu - edge.soft) / edge.height);
    return std::min(near_peak, std::max(dense, cut_out));
  }

  void measure(const Vector3i& at, BoneEdge& edge) const {
    const std::size_t i = outline_.index(at);
    const auto beside = near(at);
    double inside = fine_.values[i] > 127 ? band_voxels : -band_voxels;
    double sigma = outline_edge_voxels * mm_from_voxel_.colwise().norm().maxCoeff();
    if (beside) {
      const Profile line = profile(at, *beside);
      if (const auto found = edge_of(line)) {
        const double outer = found->place(0.5), inner = found->place(highest_level(*found));
        const double measured = (outer + inner) / 2;
        const double kept = std::clamp(measured, -beside->farthest_mm, beside->farthest_mm);
        inside = (beside->inside_mm + kept) / beside->voxel_mm;
        sigma = std::hypot((outer - inner) / std::sqrt(12.0), edge_sigma_voxels * beside->voxel_mm) +
                std::abs(measured - kept);
      } else {
        constexpr double steepness = 0.4;  // of a smoothed step, by its standard deviation
        inside = (fine_.values[i] / 255.0 - 0.5) * fine_sigma_voxels / steepness;
        sigma = outline_edge_voxels * beside->voxel_mm;
      }
    }
    const double value = 127.5 * (1 + std::clamp(inside / band_voxels, -1.0, 1.0));
    edge.inside.values[i] = static_cast<std::uint8_t>(std::lround(value));
    edge.doubt.values[i] =
        static_cast<std::uint8_t>(std::min(255L, std::lround(sigma / BoneEdge::doubt_unit_mm)));
  }

  const std::vector<float>& hu_;
  Matrix3d mm_from_voxel_, voxel_from_mm_;
  Vector3d outline_sigma_, fine_sigma_;  // in voxels
  ByteGrid outline_, fine_;
  double dense_hu_ = least_dense_hu, blur_mm_ = 0;
};

}  // namespace

BoneEdge bone_edge(const ByteGrid& bone, const std::vector<float>& hu, const Matrix3d& mm_from_voxel,
                   unsigned threads) {
  return Measurement(bone, hu, mm_from_voxel).made(threads);
}

Vector3i bone_edge_margin(const Matrix3d& mm_from_voxel) {
  const Vector3d spacing = mm_from_voxel.colwise().norm();
  const Vector3d farthest = spacing * limit_voxels + Vector3d::Constant(limit_mm + outward_mm);
  return (farthest.array() / spacing.array()).ceil().cast<int>() + 2;
}

}  // namespace helicarm::volume

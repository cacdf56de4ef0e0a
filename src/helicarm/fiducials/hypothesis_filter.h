// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "helicarm/fiducials/hypothesis.h"

namespace helicarm::fiducials {

/// Grid that marks the rough gate around each candidate, with cells of a third of the gate: one lookup per
/// projected ball.
class CandidateGrid {
 public:
  explicit CandidateGrid(const LabellingProblem& scene);

  /// Increments `count` where image coordinates, in cells, lie near a candidate.
  template <int width>
  void add_marks(const Eigen::Array<float, width, 1>& column, const Eigen::Array<float, width, 1>& line,
                 std::array<int, width>& count) const {
    using Simd = Eigen::Array<float, width, 1>;
    const auto within = [](const Simd& at, float last) -> Simd {  // NaN becomes 0
      const Simd high = (at > 0).select(at, Simd::Zero());
      return (high < last).select(high, Simd::Constant(last)).floor();
    };
    std::array<int, width> cells;
    Eigen::Map<Eigen::Array<int, width, 1>>(cells.data()) =
        (within(line, last_row_) * (last_column_ + 1) + within(column, last_column_)).template cast<int>();
    for (int i = 0; i < width; ++i) count[i] += marked_[static_cast<std::size_t>(cells[i])];
  }
  double cell_px() const { return cell_px_; }
  const Eigen::Array2d& low_px() const { return low_px_; }

 private:
  double cell_px_;
  Eigen::Array2d low_px_;
  float last_column_;
  float last_row_;
  std::vector<std::uint8_t> marked_;
};

/// A pose from three candidates: the balls assigned to them and which of the four solutions.
struct PoseHypothesis {
  std::array<int, 3> balls;
  double depth_sign;  ///< 1 or -1: of the relative depths in the starting scaled orthography
  bool mirrored;
};

/// Passes the poses of three candidates that other candidates support. SIMD form, eight poses at a time in
/// single precision, of `three_point.h`, the reference.
class HypothesisFilter {
 public:
  /// The scene must outlive the filter.
  explicit HypothesisFilter(const LabellingProblem& scene);

  /// Poses of all ordered triples of balls whose radii agree with the distance within three sigma and that
  /// have candidates near at least `required` balls.
  const std::vector<PoseHypothesis>& filter(const std::array<int, 3>& candidates, double focal_px,
                                            int required);

 private:
  static constexpr int width = 8;
  using Simd = Eigen::Array<float, width, 1>;
  struct Triangle {
    std::array<std::int16_t, 3> balls;
  };
  struct Start {
    int triangle;
    float depth_sign, behind1, behind2;
  };
  struct Image {
    Eigen::Vector2f at0, at1, at2;  ///< normalised
    float a, b, c;
    float focal_px;
  };

  void gather_starts(const std::array<int, 3>& candidates, const Image& image);
  void test(const Start* starts, int used, const Image& image, int required);

  const LabellingProblem& scene_;
  CandidateGrid near_;
  std::vector<Eigen::Vector3f> balls_;
  std::vector<Triangle> triangles_;  ///< not nearly collinear, ordered by first ball
  std::vector<int> first_of_ball_;   ///< start index among the triangles, and the end
  Eigen::ArrayXf a_, b_, c_;         ///< of the triangles
  Eigen::ArrayXf mm_per_px_;
  std::vector<std::array<float, 2>> scales_;  ///< finest and coarsest; candidate by ball
  std::vector<int> in_scale_;
  std::vector<Start> starts_;
  std::vector<PoseHypothesis> passed_;
};

}  // namespace helicarm::fiducials

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/study/simd_geometry.h"
#include "helicarm/study/simd_random.h"

namespace helicarm {

/// Where the poses of 2.3.3 put the world's origin: on the cone's axis, at its base as printed, or halfway
/// up, so that both images hold the whole cone.
enum class WorldOrigin { base, centre };
std::string_view name_of(WorldOrigin origin);

/// How N(0, 2.34) may be meant. Each gives a standard deviation per axis.
enum class SigmaReading { std, var, mean_distance, rms_distance };
inline constexpr std::array sigma_readings{SigmaReading::std, SigmaReading::var, SigmaReading::mean_distance,
                                           SigmaReading::rms_distance};
std::string_view name_of(SigmaReading reading);
double sigma_px(SigmaReading reading, double fle);

/// Stream numbers of the studies: the number of balls is added to `number_stream`.
inline constexpr std::uint32_t number_stream = 20000;
inline constexpr std::uint32_t uniformity_stream = 20100;
inline constexpr std::uint32_t location_stream = 20200;  // and the next
inline constexpr std::uint32_t biplane_stream = 20300;   // and the nine next
inline constexpr std::uint32_t calibration_stream = 20400;
inline constexpr std::uint32_t design_stream = 20500;  // and the three next
inline constexpr std::uint32_t rectification_stream = 20600;

inline constexpr double cone_height_mm = 87.5;  // 2.3.1
inline constexpr double cone_base_mm = 60;      // radii
inline constexpr double cone_top_mm = 30;
inline constexpr double space_radius_mm = 100;  // C of 2.3.3
inline constexpr double printed_fle = 2.34;
inline constexpr double image_px = 1024;  // each way

/// The AP and the lateral view of 2.3.3: f 900 mm, 0.15 mm pixels, 512, 800 mm. World: the calibrator's
/// frame.
std::array<View, 2> paper_views(WorldOrigin origin);

/// The poses' origin, mm.
Eigen::Vector3d origin_in_calibrator(WorldOrigin origin);

/// Targets at certain intervals, as 2.3.3 has them: lattice points in the ball of 100 mm about the poses'
/// origin (19, their mean squared distance that of the ball's points) and in the truncated cone. Calibrator
/// frame.
std::vector<Eigen::Vector3d> targets_in_ball(WorldOrigin origin);
std::vector<Eigen::Vector3d> targets_in_cone();
Eigen::Vector3d middle_of_cone();

/// Views ready for lanes.
class LaneViews {
 public:
  explicit LaneViews(const std::array<View, 2>& views);
  LanePixel project(std::size_t view, const LanePoint& point) const;

 private:
  double p_[2][3][4];
};

/// The place on the spiral (Eq. 9) at a share of its 3.5 turns, 0 to 1.
LanePoint on_spiral(Simd share);

/// Four groups of balls drawn at random on the spiral: uniform in the angle t.
std::vector<LanePoint> balls_on_spiral(const LaneRandom& random, std::size_t count);

/// What each number of a trial's draws is used for: one block of words gives one pixel's noise.
namespace draw {
inline constexpr std::uint32_t places = 0;         // of balls, two at a time
inline constexpr std::uint32_t calibration = 64;   // + 64 view + ball
inline constexpr std::uint32_t fresh = 192;        // likewise
inline constexpr std::uint32_t targets = 320;      // likewise
inline constexpr std::uint32_t repetition = 1024;  // between noise draws of one trial
}  // namespace draw

/// A pixel, or its noise, of each of at most 64 places in either view.
struct LanePixels {
  LanePixel of_view[2][LaneBalls::most];
};

/// Unit noise of `count` places.
void draw_noise(const LaneRandom& random, std::uint32_t from, std::size_t count, LanePixels& noise);

/// Exact pixels with noise added.
void add_noise(const LanePixels& exact, double sigma_px, const LanePixels& noise, std::size_t count,
               LanePixels& pixels);

/// At most 64 places known to all lanes, with their exact pixels.
class LaneTargets {
 public:
  LaneTargets(std::span<const Eigen::Vector3d> points, const std::array<View, 2>& views);

  std::size_t size() const { return points_.size(); }
  /// Mean distance (Eq. 12) of where calibrated views place the targets begin .. end - 1 from where they are;
  /// their pixels carry noise where it is given.
  Simd mean_error(std::size_t begin, std::size_t end, const LaneProjection (&views)[2], double sigma_px,
                  const LanePixels* noise) const;
  /// Mean squared distance likewise, of exact pixels.
  Simd mean_square(std::size_t begin, std::size_t end, const LaneProjection (&views)[2]) const;

 private:
  std::vector<LanePoint> points_;
  LanePixels exact_;
};

}  // namespace helicarm

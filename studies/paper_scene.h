// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "studies/simd_geometry.h"
#include "studies/simd_random.h"

namespace helicarm::study {

/// Origin of the world frame of 2.3.3's poses: on the cone's axis, at its base as published, or at half
/// height, so that both images contain the whole cone.
enum class WorldOrigin { base, centre };
std::string_view name_of(WorldOrigin origin);

/// Possible readings of N(0, 2.34). Each gives a standard deviation per axis.
enum class SigmaReading { std, var, mean_distance, rms_distance };
inline constexpr std::array sigma_readings{SigmaReading::std, SigmaReading::var, SigmaReading::mean_distance,
                                           SigmaReading::rms_distance};
std::string_view name_of(SigmaReading reading);
double sigma_px(SigmaReading reading, double fle);

/// Stream numbers of the studies; the number of balls is added to `number_stream`.
inline constexpr std::uint32_t number_stream = 20000;
inline constexpr std::uint32_t uniformity_stream = 20100;
inline constexpr std::uint32_t location_stream = 20200;  // and the next one
inline constexpr std::uint32_t biplane_stream = 20300;   // and the next nine
inline constexpr std::uint32_t calibration_stream = 20400;
inline constexpr std::uint32_t design_stream = 20500;  // and the next three
inline constexpr std::uint32_t rectification_stream = 20600;
inline constexpr std::uint32_t bench_stream = 20700;  // of the study of calibration

inline constexpr double cone_height_mm = 87.5;  // 2.3.1
inline constexpr double cone_base_mm = 60;      // radii
inline constexpr double cone_top_mm = 30;
inline constexpr double space_radius_mm = 100;  // C of 2.3.3
inline constexpr double printed_fle = 2.34;
inline constexpr double image_px = 1024;  // per side

/// The AP and lateral views of 2.3.3: f 900 mm, 0.15 mm pixels, 512, 800 mm. World: the calibrator frame.
std::array<geometry::View, 2> paper_views(WorldOrigin origin);

/// The poses' origin, mm.
Eigen::Vector3d origin_in_calibrator(WorldOrigin origin);

/// Targets at certain intervals, as in 2.3.3: lattice points in the sphere of 100 mm about the poses' origin
/// (19, with the mean squared distance of the sphere's points) and in the truncated cone. Calibrator frame.
std::vector<Eigen::Vector3d> targets_in_ball(WorldOrigin origin);
std::vector<Eigen::Vector3d> targets_in_cone();
Eigen::Vector3d middle_of_cone();

/// Views in SIMD form.
class SimdViews {
 public:
  explicit SimdViews(const std::array<geometry::View, 2>& views);
  SimdPixel project(std::size_t view, const SimdPoint& point) const;

 private:
  double p_[2][3][4];
};

/// The position on the spiral (Eq. 9) at a fraction of its 3.5 turns, 0 to 1.
SimdPoint on_spiral(Simd share);

/// Four groups of balls drawn at random on the spiral, uniform in the angle t.
std::vector<SimdPoint> balls_on_spiral(const SimdRandom& random, std::size_t count);

/// Numbers of a trial's random blocks; one block of words gives the noise of one pixel.
namespace draw {
inline constexpr std::uint32_t places = 0;         // of balls, two per block
inline constexpr std::uint32_t calibration = 64;   // + 64 view + ball
inline constexpr std::uint32_t fresh = 192;        // + 64 view + ball
inline constexpr std::uint32_t targets = 320;      // + 64 view + target
inline constexpr std::uint32_t repetition = 1024;  // offset between noise draws of one trial
}  // namespace draw

/// A pixel, or its noise, of each of at most 64 points in either view.
struct SimdPixels {
  SimdPixel of_view[2][SimdBalls::most];
};

/// Unit noise of `count` points.
void draw_noise(const SimdRandom& random, std::uint32_t from, std::size_t count, SimdPixels& noise);

/// Exact pixels plus noise.
void add_noise(const SimdPixels& exact, double sigma_px, const SimdPixels& noise, std::size_t count,
               SimdPixels& pixels);

/// At most 64 points known to all lanes, with their exact pixels.
class SimdTargets {
 public:
  SimdTargets(std::span<const Eigen::Vector3d> points, const std::array<geometry::View, 2>& views);

  std::size_t size() const { return points_.size(); }
  /// Mean distance (Eq. 12) between the points triangulated by calibrated views and the true targets begin ..
  /// end - 1; their pixels have noise if it is given.
  Simd mean_error(std::size_t begin, std::size_t end, const SimdProjection (&views)[2], double sigma_px,
                  const SimdPixels* noise) const;
  /// Mean squared distance, with exact pixels.
  Simd mean_square(std::size_t begin, std::size_t end, const SimdProjection (&views)[2]) const;

 private:
  std::vector<SimdPoint> points_;
  SimdPixels exact_;
};

}  // namespace helicarm::study

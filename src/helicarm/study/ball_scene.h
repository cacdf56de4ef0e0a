// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/simulation/detector_response.h"
#include "helicarm/simulation/render_view.h"
#include "helicarm/simulation/scene.h"

namespace helicarm {

/// What lies across a ball.
enum class Companion { none, ball, plate_dot, wire_in_the_middle, wire_beside, bone };

/// One ball in a square of its own. Frame: the camera's, mm.
struct BallTile {
  Eigen::Vector3d ball;
  Eigen::Vector2d towards;   ///< in the image: where the companion lies, else the brighter side
  simulation::Scene bodies;  ///< the ball first, then what lies across it
  int left, top;             ///< of the square, px
};

/// An image's worth of steel balls, 750 mm from the source and 247 mm from the receiver, in an ellipsoid of
/// muscle that grows thinner towards the sides.
struct BallScene {
  static constexpr int side_px = 96;  ///< of a ball's square
  double diameter_mm;
  View view;
  simulation::VirtualDetector detector;
  simulation::Body muscle;
  std::vector<BallTile> tiles;

  double radius_px() const;
  Image<float> signal() const;
};

/// Whether a square's ball stands alone whatever the others' companion: those tell the look.
inline bool is_alone(std::size_t tile) { return tile % 8 == 0; }

/// `squares` across the image, a ball in each.
BallScene ball_scene(double diameter_mm, Companion companion, int squares, std::uint64_t seed,
                     std::uint64_t image);

/// The bound (Cramer and Rao) on the standard deviation per axis of the ball's centre, px, from the pixels
/// around it up to `window_px` beyond each rim, when places and radii of all balls in the square, a quadratic
/// background and the scatter are unknown. Derivatives are differences of renderings.
double centre_bound_px(const BallScene& scene, const BallTile& tile, const simulation::Light& light,
                       const simulation::Imaging& imaging, double window_px);

}  // namespace helicarm

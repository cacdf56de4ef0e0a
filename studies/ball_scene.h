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

namespace helicarm::study {

/// What overlaps or adjoins a ball.
enum class Companion { none, ball, plate_dot, wire_in_the_middle, wire_beside, bone };

/// One ball in its own square of the image. Frame: the camera's, mm.
struct BallTile {
  Eigen::Vector3d ball;
  Eigen::Vector2d towards;   ///< direction in the image to the companion, else to the brighter side
  simulation::Scene bodies;  ///< the ball first, then its companions
  int left, top;             ///< of the square, px
};

/// Steel balls that fill an image, 750 mm from the source and 247 mm from the receiver, in an ellipsoid of
/// muscle that becomes thinner towards the sides.
struct BallScene {
  static constexpr int side_px = 96;  ///< of a ball's square
  double diameter_mm;
  geometry::View view;
  simulation::VirtualDetector detector;
  simulation::Body muscle;
  std::vector<BallTile> tiles;

  double radius_px() const;
  image::Image<float> signal() const;
};

/// Whether a square's ball has no companion; these balls give the common appearance.
inline bool is_alone(std::size_t tile) { return tile % 8 == 0; }

/// `squares` across the image, one ball in each.
BallScene ball_scene(double diameter_mm, Companion companion, int squares, std::uint64_t seed,
                     std::uint64_t image);

/// The Cramer-Rao bound on the standard deviation per axis of the ball's centre, px, from the pixels up to
/// `window_px` beyond each rim, with unknown positions and radii of all balls in the square, quadratic
/// background and scatter. Derivatives are differences of renderings.
double centre_bound_px(const BallScene& scene, const BallTile& tile, const simulation::Light& light,
                       const simulation::Imaging& imaging, double window_px);

}  // namespace helicarm::study

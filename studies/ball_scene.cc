// SPDX-License-Identifier: Apache-2.0
#include "studies/ball_scene.h"

#include <cmath>
#include <numbers>

#include <Eigen/SparseCore>
#include <opencv2/imgproc.hpp>

#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/image/opencv.h"

namespace helicarm::study {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double source_detector_mm = 997;
constexpr double pixel_mm = 0.2295;
constexpr double depth_mm = 750;
constexpr int margin_px = 32;
constexpr std::uint32_t places_stream = 3000;

constexpr double plate_depth_mm = 982, plate_dot_mm = 2.5;  // plate48 on its receiver
constexpr double wire_depth_mm = 735, wire_mm = 2;
constexpr double a_third =
    0.265;  // of the radius: beyond it, or between it and its like, lies a third of the disc
constexpr double bone_depth_mm = 770, bone_mm = 6;
constexpr double rod_half_px = 36;  // of a wire or bone: inside the square, longer than the fit's window

Vector3d point_at(const geometry::View& view, const Vector2d& pixel, double depth) {
  const geometry::Intrinsics& k = view.intrinsics;
  return {(pixel.x() - k.u0) / k.fx * depth, (pixel.y() - k.v0) / k.fy * depth, depth};
}

/// A straight rod across the square, its axis `offset_px` from the ball in the image.
simulation::Solid rod(const geometry::View& view, const Vector2d& ball, const Vector2d& towards,
                      double offset_px, double depth, double diameter) {
  const Vector2d along(-towards.y(), towards.x());
  const Vector2d middle = ball + offset_px * towards;
  return simulation::cylinder(point_at(view, middle - rod_half_px * along, depth),
                              point_at(view, middle + rod_half_px * along, depth), diameter / 2);
}

simulation::Body companion_body(const BallScene& scene, Companion companion, const Vector2d& ball,
                                const Vector2d& towards) {
  const double f = scene.view.intrinsics.fx;
  const double radius = scene.radius_px();
  switch (companion) {
    case Companion::none:
      return {};
    case Companion::ball:
      return simulation::steel(
          "ball", {simulation::sphere(point_at(scene.view, ball + 1.5 * radius * towards, depth_mm),
                                      scene.diameter_mm / 2)});
    case Companion::plate_dot:
      return simulation::steel(
          "dot", {simulation::sphere(point_at(scene.view, ball + radius * towards, plate_depth_mm),
                                     plate_dot_mm / 2)});
    case Companion::wire_in_the_middle:
      return simulation::steel("wire", {rod(scene.view, ball, towards, 0, wire_depth_mm,
                                            2 * a_third * radius / f * wire_depth_mm)});
    case Companion::wire_beside:
      return simulation::steel(
          "wire", {rod(scene.view, ball, towards, a_third * radius + f * wire_mm / 2 / wire_depth_mm,
                       wire_depth_mm, wire_mm)});
    case Companion::bone:
      return {"bone",
              {rod(scene.view, ball, towards, f * bone_mm / 2 / bone_depth_mm, bone_depth_mm, bone_mm)},
              simulation::material::cortical_bone};
  }
  return {};
}

struct Sphere {
  Vector3d centre;
  double radius;
};

/// One square with its balls only.
image::Image<float> signal_of(const BallScene& scene, const BallTile& tile, std::span<const Sphere> balls,
                              double focus_sigma_px) {
  geometry::View view = scene.view;
  view.intrinsics.u0 -= tile.left;
  view.intrinsics.v0 -= tile.top;
  simulation::VirtualDetector detector = scene.detector;
  detector.width = detector.height = BallScene::side_px;
  simulation::Scene bodies{scene.muscle};
  for (const Sphere& ball : balls)
    bodies.push_back(simulation::steel("ball", {simulation::sphere(ball.centre, ball.radius)}));
  image::Image<float> signal = simulation::render_view(bodies, detector, view, 1);
  if (focus_sigma_px > 0) {
    cv::Mat mat = image::as_mat(signal);
    cv::GaussianBlur(mat, mat, {}, focus_sigma_px, focus_sigma_px, cv::BORDER_REPLICATE);
  }
  return signal;
}

}  // namespace

double BallScene::radius_px() const { return view.intrinsics.fx * diameter_mm / 2 / depth_mm; }

image::Image<float> BallScene::signal() const {
  // Each square is rendered alone, so that a ray crosses few bodies.
  image::Image<float> image = simulation::render_view({muscle}, detector, view, 1);
  for (const BallTile& tile : tiles) {
    geometry::View shifted = view;
    shifted.intrinsics.u0 -= tile.left;
    shifted.intrinsics.v0 -= tile.top;
    simulation::VirtualDetector square = detector;
    square.width = square.height = side_px;
    simulation::Scene bodies = tile.bodies;
    bodies.push_back(muscle);
    const image::Image<float> part = simulation::render_view(bodies, square, shifted, 1);
    for (int v = 0; v < side_px; ++v)
      for (int u = 0; u < side_px; ++u) image(tile.left + u, tile.top + v) = part(u, v);
  }
  return image;
}

BallScene ball_scene(double diameter_mm, Companion companion, int squares, std::uint64_t seed,
                     std::uint64_t image) {
  RandomStream random(seed, places_stream, image);
  BallScene scene;
  scene.diameter_mm = diameter_mm;
  scene.detector.pixel_mm = pixel_mm;
  scene.detector.width = scene.detector.height = squares * BallScene::side_px + 2 * margin_px;
  const double f = source_detector_mm / pixel_mm;
  const double middle = 0.5 * (scene.detector.width - 1);
  scene.view.intrinsics = {f, f, middle, middle, 0};
  const double turn = random.uniform(0, std::numbers::pi);
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(turn, Vector3d::UnitZ()).toRotationMatrix();
  scene.muscle = {"muscle",
                  {simulation::ellipsoid({0, 0, depth_mm}, {125, 300, 60}, rotation)},
                  simulation::material::muscle};
  const Vector2d across(std::cos(turn), std::sin(turn));
  for (int i = 0; i < squares * squares; ++i) {
    BallTile tile;
    tile.left = margin_px + i % squares * BallScene::side_px;
    tile.top = margin_px + i / squares * BallScene::side_px;
    const Vector2d pixel = Vector2d(tile.left, tile.top) + Vector2d::Constant(0.5 * BallScene::side_px) +
                           in_box(random, Vector2d(-1, -1), Vector2d(1, 1));
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    tile.ball = point_at(scene.view, pixel, depth_mm);
    tile.bodies.push_back(simulation::steel("ball", {simulation::sphere(tile.ball, diameter_mm / 2)}));
    tile.towards = tile.ball.head<2>().dot(across) > 0 ? across : Vector2d(-across);
    if (companion != Companion::none && !is_alone(std::size_t(i))) {
      tile.towards = {std::cos(angle), std::sin(angle)};
      tile.bodies.push_back(companion_body(scene, companion, pixel, tile.towards));
    }
    scene.tiles.push_back(std::move(tile));
  }
  return scene;
}

double centre_bound_px(const BallScene& scene, const BallTile& tile, const simulation::Light& light,
                       const simulation::Imaging& imaging, double window_px) {
  constexpr int side = BallScene::side_px;
  using Pixels = Eigen::Map<const Eigen::Array<float, side, side, Eigen::RowMajor>>;
  std::vector<Sphere> balls;
  for (const simulation::Body& body : tile.bodies) {
    const Eigen::Affine3d& place = body.solids.front().world_from_unit;
    balls.push_back({place.translation(), place.linear().col(0).norm()});
  }
  // By the ball's position on the receiver and its radius, both in px.
  std::vector<Eigen::ArrayXXd> slopes;
  const auto image = [&] {
    const image::Image<float> signal = signal_of(scene, tile, balls, imaging.focus_sigma_px);
    return Eigen::ArrayXXd(light.quanta * Pixels(signal.pixels().data()).cast<double>());
  };
  const Eigen::ArrayXXd direct = image();
  for (Sphere& ball : balls) {
    const Sphere true_ball = ball;
    const double mm_per_px = ball.centre.z() / scene.view.intrinsics.fx;
    constexpr double step_px = 0.1;
    const auto differentiate = [&](double& number) {
      const double value = number;
      number = value + step_px * mm_per_px;
      const Eigen::ArrayXXd more = image();
      number = value - step_px * mm_per_px;
      slopes.push_back((more - image()) / (2 * step_px));
      number = value;
    };
    differentiate(ball.centre.x());
    differentiate(ball.centre.y());
    differentiate(ball.radius);
    ball = true_ball;
  }
  slopes.push_back(Eigen::ArrayXXd::Constant(side, side, direct.mean()));  // scatter
  Eigen::ArrayXXd x(side, side), y(side, side), mean(side, side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u) {
      x(v, u) = (u - 0.5 * side) / (0.25 * side), y(v, u) = (v - 0.5 * side) / (0.25 * side);
      mean(v, u) = light.quanta * double(light.level(tile.left + u, tile.top + v));
    }
  for (const Eigen::ArrayXXd& shape :
       {Eigen::ArrayXXd::Ones(side, side).eval(), x, y, (x * x).eval(), (x * y).eval(), (y * y).eval()})
    slopes.push_back(direct * shape);

  std::vector<std::array<int, 2>> window;
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u)
      for (const Sphere& ball : balls) {
        const Vector2d middle = scene.view.project(ball.centre) - Vector2d(tile.left, tile.top);
        const double radius = scene.view.intrinsics.fx * ball.radius / ball.centre.z();
        if ((Vector2d(u, v) - middle).norm() > radius + window_px) continue;
        window.push_back({u, v});
        break;
      }
  // The screen's blur also acts on the quantum noise; electronic noise and rounding are white.
  const double sigma = imaging.screen_sigma_px;
  cv::Mat taps(1, 1, CV_64F, cv::Scalar(1));
  if (sigma > 0) taps = cv::getGaussianKernel(2 * int(std::ceil(4 * sigma)) + 1, sigma, CV_64F);
  const int reach = taps.rows / 2;
  const auto n = Eigen::Index(window.size());
  std::vector<Eigen::Triplet<double>> shares;
  for (Eigen::Index i = 0; i < n; ++i)
    for (int dv = -reach; dv <= reach; ++dv)
      for (int du = -reach; du <= reach; ++du) {
        const int u = window[std::size_t(i)][0] + du, v = window[std::size_t(i)][1] + dv;
        if (u >= 0 && v >= 0 && u < side && v < side)
          shares.emplace_back(int(i), v + side * u,
                              taps.at<double>(du + reach) * taps.at<double>(dv + reach));
      }
  Eigen::SparseMatrix<double, Eigen::RowMajor> spread(n, Eigen::Index{side} * side);
  spread.setFromTriplets(shares.begin(), shares.end());
  Eigen::MatrixXd seen(n, Eigen::Index(slopes.size()));
  for (std::size_t k = 0; k < slopes.size(); ++k)
    seen.col(Eigen::Index(k)) = spread * slopes[k].matrix().reshaped();
  const double step = light.quanta / (imaging.open_level * ((1 << imaging.bits) - 1));
  const double white =
      imaging.electronic_noise * imaging.electronic_noise + (imaging.logarithmic ? 0 : step * step / 12);
  for (Eigen::Index i = 0; i < n; ++i)
    for (decltype(spread)::InnerIterator share(spread, i); share; ++share)
      share.valueRef() *= std::sqrt(mean(share.col() % side, share.col() / side));
  const Eigen::SparseMatrix<double, Eigen::RowMajor> common = spread * spread.transpose();
  const Eigen::MatrixXd covariance = white * Eigen::MatrixXd::Identity(n, n) + Eigen::MatrixXd(common);
  const Eigen::MatrixXd bound =
      geometry::inverse(seen.transpose() * geometry::solve_spd(covariance, seen).solution);
  return std::sqrt(0.5 * (bound(0, 0) + bound(1, 1)));
}

}  // namespace helicarm::study

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/poses_anywhere.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/nearest_point.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2i;
using Eigen::Vector3d;
using geometry::RigidTransform;
using Gradients = cv::Mat2f;

constexpr int orientation_count = 4608;  // about 15 degrees apart
constexpr int patch_side = 8;            // side, pixels of the raster

/// Number `i` of nearly uniform rotations (super-Fibonacci spirals, Alexa 2022); those between are turned
/// from them by half of their distance about one axis of the model.
Eigen::Matrix3d orientation(Orientations orientations, int i) {
  constexpr double phi = 1.4142135623730951, psi = 1.533751168755204288118041;
  const double s = i + 0.5, t = s / orientation_count;
  const double a = 2 * EIGEN_PI * s / phi, b = 2 * EIGEN_PI * s / psi;
  const double r = std::sqrt(t), q = std::sqrt(1 - t);
  const Eigen::Quaterniond first(q * std::cos(b), r * std::sin(a), r * std::cos(a), q * std::sin(b));
  if (orientations == Orientations::first) return first.toRotationMatrix();
  const Vector3d step = Vector3d(1, 1, 1).normalized() * 7.5 * EIGEN_PI / 180;
  return first.toRotationMatrix() * geometry::rotation_from_vector(step);
}

/// Correlates a view's image with the model's DRR at every shift.
class ViewSearch {
 public:
  ViewSearch(const Raster& raster, const geometry::View& view, const Model& model, const Density& density,
             const Vector3d& middle)
      : view_(view), model_(model), density_(density), middle_(middle), raster_(raster) {
    const Vector2i image(raster.attenuation.width(), raster.attenuation.height());
    double reach = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d voxel((corner & 1) ? density.size.x() - 1 : 0, (corner & 2) ? density.size.y() - 1 : 0,
                           (corner & 4) ? density.size.z() - 1 : 0);
      reach = std::max(reach, (density.model_from_voxel * voxel - model.centre).norm());
    }
    const double px_per_mm =
        std::abs(view.intrinsics.fy) / (view.depth(middle) - 0.5 * reach) / raster.factor;
    half_ = std::min(int(std::ceil(reach * px_per_mm)) + 1, image.maxCoeff());
    size_ = {cv::getOptimalDFTSize(image.x() + half_), cv::getOptimalDFTSize(image.y() + half_)};
    at_middle_ = raster.raster_at(view.project(middle)).array().round().cast<int>();
    world_from_pixel_ = view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
    cv::dft(image_gradients(), image_, cv::DFT_COMPLEX_OUTPUT);
  }

  /// Agreement at every shift of the model from the middle, of -1 .. 1.
  cv::Mat1f agreement(const Eigen::Matrix3d& rotation) const {
    const PosedDensity posed(density_, {rotation, middle_ - rotation * model_.centre},
                             view_.source_in_world(), middle_);
    const int side = 2 * half_ + 1;
    cv::Mat1f drr(side, side, 0.0F);
    std::array<Vector3d, 8> directions;
    std::array<float, 8> values;
    for (int v = 0; v < side; ++v)
      for (int u = 0; u < side; u += 8) {
        for (int k = 0; k < 8; ++k) directions[std::size_t(k)] = direction({std::min(u + k, side - 1), v});
        posed.integrate_eight(directions, values);
        for (int k = 0; k < 8 && u + k < side; ++k) drr(v, u + k) = values[std::size_t(k)];
      }
    Gradients placed(size_.y(), size_.x(), cv::Vec2f(0, 0));
    const auto wrapped = [](int at, int size) { return (at % size + size) % size; };
    double total = 0;
    for (int v0 = 1; v0 + 1 < side; v0 += patch_side)
      for (int u0 = 1; u0 + 1 < side; u0 += patch_side) {
        cv::Vec2d sum(0, 0);
        double squares = 0;
        for (int v = v0; v < std::min(v0 + patch_side, side - 1); ++v)
          for (int u = u0; u < std::min(u0 + patch_side, side - 1); ++u) {
            const cv::Vec2f g(drr(v, u + 1) - drr(v, u - 1), drr(v + 1, u) - drr(v - 1, u));
            placed(wrapped(v - half_, size_.y()), wrapped(u - half_, size_.x())) = g;
            sum += cv::Vec2d(g);
            squares += g.dot(g);
          }
        total += std::sqrt(std::max(0.0, squares - sum.dot(sum) / (patch_side * patch_side)));
      }
    Gradients spectrum;
    cv::dft(placed, spectrum, cv::DFT_COMPLEX_OUTPUT);
    cv::mulSpectrums(image_, spectrum, spectrum, 0, true);
    cv::dft(spectrum, spectrum, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_COMPLEX_OUTPUT);
    cv::Mat1f real;
    cv::extractChannel(spectrum, real, 0);
    return real / std::max(total, 1e-12);
  }

  /// Index of a place of the model's centre in `agreement`; -1: not in the image.
  int index_of(const Vector3d& at) const {
    if (!(view_.depth(at) > 1)) return -1;
    const Vector2i pixel = raster_.raster_at(view_.project(at)).array().round().cast<int>();
    if (!raster_.attenuation.contains(pixel.x(), pixel.y())) return -1;
    return pixel.y() * size_.x() + pixel.x();
  }

 private:
  Vector3d direction(const Vector2i& of_template) const {
    const Vector2i at = at_middle_ + of_template - Vector2i::Constant(half_);
    return (world_from_pixel_ * raster_.pixel_at(at.cast<double>()).homogeneous()).normalized();
  }

  /// Without their mean over the patch about them, which then has a norm of 1.
  Gradients image_gradients() const {
    const auto& image = raster_.attenuation;
    Gradients gradients(image.height(), image.width(), cv::Vec2f(0, 0));
    cv::Mat1f valid(image.height(), image.width(), 0.0F), squares = valid.clone();
    for (int v = 1; v + 1 < image.height(); ++v)
      for (int u = 1; u + 1 < image.width(); ++u) {
        if (!raster_.valid(u - 1, v) || !raster_.valid(u + 1, v) || !raster_.valid(u, v - 1) ||
            !raster_.valid(u, v + 1))
          continue;
        gradients(v, u) = {image(u + 1, v) - image(u - 1, v), image(u, v + 1) - image(u, v - 1)};
        squares(v, u) = gradients(v, u).dot(gradients(v, u));
        valid(v, u) = 1;
      }
    const double noise = 0.01 * cv::mean(squares, valid > 0)[0] * patch_side * patch_side;
    const auto summed = [](const cv::Mat& over) {
      cv::Mat sums;
      cv::boxFilter(over, sums, -1, {patch_side, patch_side}, {-1, -1}, false, cv::BORDER_CONSTANT);
      return sums;
    };
    const Gradients sums = summed(gradients);
    const cv::Mat1f counts = summed(valid), square_sums = summed(squares);
    Gradients normal(size_.y(), size_.x(), cv::Vec2f(0, 0));
    for (int v = 0; v < image.height(); ++v)
      for (int u = 0; u < image.width(); ++u) {
        if (valid(v, u) == 0) continue;
        const cv::Vec2f mean = sums(v, u) / counts(v, u);
        const double rest = square_sums(v, u) - counts(v, u) * mean.dot(mean);
        normal(v, u) = (gradients(v, u) - mean) / float(std::sqrt(std::max(0.0, rest) + noise + 1e-20));
      }
    return normal;
  }

  const geometry::View& view_;
  const Model& model_;
  const Density& density_;
  Vector3d middle_;
  const Raster& raster_;
  int half_;       // of the DRR
  Vector2i size_;  // of the spectra
  Vector2i at_middle_;
  Eigen::Matrix3d world_from_pixel_;
  Gradients image_;
};

/// Places that all views show, with their indices there.
struct Place {
  Vector3d at;
  std::vector<int> indices;
};

std::optional<Place> place_at(const std::vector<ViewSearch>& views, const Vector3d& at) {
  Place place{at, {}};
  for (const ViewSearch& view : views) {
    place.indices.push_back(view.index_of(at));
    if (place.indices.back() < 0) return std::nullopt;
  }
  return place;
}

std::vector<Place> places_about(const std::vector<ViewSearch>& views, const Vector3d& middle, double step,
                                int steps) {
  std::vector<Place> places;
  for (int z = -steps; z <= steps; ++z)
    for (int y = -steps; y <= steps; ++y)
      for (int x = -steps; x <= steps; ++x)
        if (auto place = place_at(views, middle + step * Vector3d(x, y, z)))
          places.push_back(std::move(*place));
  return places;
}

std::vector<float> scores_at(const std::vector<Place>& places, const std::vector<cv::Mat1f>& agreements) {
  std::vector<float> scores(places.size(), 0);
  for (std::size_t v = 0; v < agreements.size(); ++v) {
    const auto* agreement = agreements[v].ptr<float>();
    for (std::size_t p = 0; p < places.size(); ++p) scores[p] += agreement[places[p].indices[v]];
  }
  return scores;
}

struct Candidate {
  RigidTransform pose;
  double score = -1;
};

/// The best places of one orientation among places `2 * spacing` apart, then between them.
template <std::size_t count>
std::array<Candidate, count> best_places(const std::vector<ViewSearch>& views,
                                         const std::vector<Place>& places, const Eigen::Matrix3d& rotation,
                                         const Vector3d& centre, double spacing) {
  std::vector<cv::Mat1f> agreements, about(views.size());
  for (std::size_t v = 0; v < views.size(); ++v) {
    agreements.push_back(views[v].agreement(rotation));
    cv::dilate(agreements[v], about[v], cv::Mat());
  }
  std::vector<float> scores = scores_at(places, about);
  std::array<Candidate, count> best;
  for (Candidate& candidate : best) {
    const auto p = std::size_t(std::ranges::max_element(scores) - scores.begin());
    if (p == scores.size()) break;
    const std::vector<Place> near = places_about(views, places[p].at, spacing, 1);
    const std::vector<float> exact = scores_at(near, agreements);
    const auto k = std::size_t(std::ranges::max_element(exact) - exact.begin());
    candidate = {{rotation, near[k].at - rotation * centre}, exact[k]};
    for (std::size_t other = 0; other < places.size(); ++other)
      if ((places[other].at - places[p].at).squaredNorm() < std::pow(4 * spacing, 2)) scores[other] = -1;
  }
  return best;
}

}  // namespace

Vector3d middle_of(const std::vector<RegistrationView>& views) {
  std::vector<geometry::Ray> rays;
  for (const RegistrationView& view : views)
    rays.push_back(geometry::central_ray(view.view, view.grey.width(), view.grey.height()));
  return geometry::middle_of(rays);
}

/// From the views' middle, along each axis: the places of a small model lie closer together, and their number
/// grows with the third power.
double farthest_mm(double spacing_mm) {
  constexpr double least = 80, most = 150, places_per_axis = 55;
  return std::clamp(places_per_axis * spacing_mm, least, most);
}

Level level_anywhere(const Model& model) { return {false, std::clamp(model.radius_mm / 8, 1.0, 6.0)}; }

std::vector<RigidTransform> poses_anywhere(const RegistrationProblem& scene, Orientations orientations,
                                           std::size_t count, const std::function<void()>& interrupt,
                                           const TellShare& share) {
  const Model& model = scene.model();
  const Level level = level_anywhere(model);
  const Vector3d middle = middle_of(scene.views());
  std::vector<ViewSearch> views;
  for (std::size_t i = 0; i < scene.views().size(); ++i)
    views.emplace_back(scene.raster(level, i), scene.views()[i].view, model, scene.density(level), middle);
  const auto places = places_about(views, middle, 2 * level.spacing_mm,
                                   int(farthest_mm(level.spacing_mm) / (2 * level.spacing_mm)));
  constexpr std::size_t each = 2;
  std::vector<Candidate> found(std::size_t(orientation_count) * each);
  UnitsDone done(share, orientation_count);
  parallel_for(orientation_count, scene.threads(), [&](std::size_t i) {
    if (interrupt) interrupt();
    std::ranges::copy(
        best_places<each>(views, places, orientation(orientations, int(i)), model.centre, level.spacing_mm),
        found.begin() + std::ptrdiff_t(each * i));
    done.one();
  });
  std::ranges::stable_sort(found, [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
  std::vector<RigidTransform> poses;
  for (const Candidate& candidate : found) {
    if (poses.size() == count || candidate.score <= 0) break;
    if (interrupt) interrupt();
    // The centre is the mean of the samples: it moves by no more than they do.
    if (std::ranges::none_of(poses, [&](const RigidTransform& pose) {
          return (pose * model.centre - candidate.pose * model.centre).norm() < level.spacing_mm &&
                 separation(model, pose, candidate.pose) < level.spacing_mm;
        }))
      poses.push_back(candidate.pose);
  }
  return poses;
}

}  // namespace helicarm::registration

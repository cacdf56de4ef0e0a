// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/bone_edge.h"

#include <cmath>
#include <functional>

#include <Eigen/Geometry>
#include <gmock/gmock.h>

#include "helicarm/core/random.h"

namespace helicarm::volume {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double radius_mm = 12;
constexpr double soft_hu = 50, spongy_hu = 250, cortex_hu = 1350;

double step_down(double at, double blur_mm) { return std::erfc(at / blur_mm / std::sqrt(2.0)) / 2; }

/// A rod along z as a scanner shows it: blurred, with noise. `outside`: what lies beyond it, HU by the
/// distance from its surface.
struct Rod {
  double cortex_mm = 4, blur_mm = 0.6, noise_hu = 20;
  std::function<double(double)> outside = [](double) { return soft_hu; };

  double at(double from_surface) const {
    const double outer = step_down(from_surface, blur_mm),
                 inner = step_down(from_surface + cortex_mm, blur_mm);
    return outside(from_surface) * (1 - outer) + cortex_hu * (outer - inner) + spongy_hu * inner;
  }
};

struct Scan {
  Vector3i size;
  Matrix3d mm_from_voxel;
  ByteGrid mask;
  std::vector<float> hu;

  Vector3d place(const Vector3d& voxel) const {
    return mm_from_voxel * (voxel - 0.5 * (size - Vector3i::Ones()).cast<double>()) +
           Vector3d(0.13, -0.21, 0);
  }
  Vector3d voxel(const Vector3d& place) const {
    return mm_from_voxel.inverse() * (place - Vector3d(0.13, -0.21, 0)) +
           0.5 * (size - Vector3i::Ones()).cast<double>();
  }
};

/// `is_bone`: of the distance from the surface and the value.
Scan scan_of(const Rod& rod, const Matrix3d& mm_from_voxel,
             const std::function<bool(double, double)>& is_bone) {
  Scan scan{.size = {0, 0, 9}, .mm_from_voxel = mm_from_voxel, .mask = {}, .hu = {}};
  for (const int axis : {0, 1}) scan.size[axis] = int(36 / mm_from_voxel.col(axis).norm());
  scan.mask = byte_grid(scan.size);
  RandomStream random(5, 1);
  scan.mask.each([&](const Vector3i& at) {
    const double from_surface = scan.place(at.cast<double>()).head<2>().norm() - radius_mm;
    const double value = rod.at(from_surface);
    scan.mask.values[scan.mask.index(at)] = is_bone(from_surface, value);
    scan.hu.push_back(static_cast<float>(value + rod.noise_hu * random.normal()));
  });
  return scan;
}

struct Errors {
  double mean = 0, rms = 0, sigma = 0;
};

/// Of the surface around the rod's middle.
Errors errors_of(const Scan& scan) {
  const BoneEdge edge = bone_edge(scan.mask, scan.hu, scan.mm_from_voxel);
  constexpr int places = 100;
  Errors errors;
  for (int i = 0; i < places; ++i) {
    const double angle = 2 * EIGEN_PI * i / places;
    const Vector3d out(std::cos(angle), std::sin(angle), 0);
    double inside = radius_mm - 4, outside = radius_mm + 4;
    EXPECT_GT(edge.excess(scan.voxel(inside * out)), 0);
    EXPECT_LT(edge.excess(scan.voxel(outside * out)), 0);
    while (outside - inside > 1e-4) {
      const double middle = (inside + outside) / 2;
      (edge.excess(scan.voxel(middle * out)) > 0 ? inside : outside) = middle;
    }
    const double error = inside - radius_mm;
    errors.mean += error / places;
    errors.rms += error * error / places;
    errors.sigma += std::pow(edge.sigma_mm(scan.voxel(inside * out)), 2) / places;
  }
  errors.rms = std::sqrt(errors.rms), errors.sigma = std::sqrt(errors.sigma);
  return errors;
}

const Matrix3d fine = 0.4 * Matrix3d::Identity();
const auto is_itself = [](double from_surface, double) { return from_surface < 0; };

TEST(BoneEdge, IsTheSameOfEveryOutlineNearIt) {
  const double itself = errors_of(scan_of({}, fine, is_itself)).mean;
  EXPECT_NEAR(itself, 0, 0.03);
  for (const double grown_mm : {-0.4, 0.4, 0.8})
    EXPECT_NEAR(errors_of(scan_of({}, fine, [&](double d, double) { return d < grown_mm; })).mean, itself,
                0.02)
        << grown_mm;
  for (const double threshold : {200.0, 400.0})
    EXPECT_NEAR(
        errors_of(scan_of({}, fine, [&](double d, double hu) { return d < -2 || hu > threshold; })).mean,
        itself, 0.02)
        << threshold;
}

TEST(BoneEdge, LiesBetweenVoxelsOfThickTiltedSlices) {
  Matrix3d slices = Eigen::AngleAxisd(0.3, Vector3d(1, 2, 0.5).normalized()).toRotationMatrix();
  slices *= Vector3d(0.5, 0.6, 1.25).asDiagonal();
  slices.col(2) += 0.3 * slices.col(1);
  const Errors errors = errors_of(scan_of({}, slices, is_itself));
  EXPECT_LT(errors.rms, 0.06);
  EXPECT_LT(std::abs(errors.mean), 2 * errors.sigma);
}

TEST(BoneEdge, OfAThinBlurredCortexIsLessCertain) {
  double last = 0.06;
  for (const double cortex_mm : {1.5, 1.0, 0.7}) {
    const Errors errors = errors_of(scan_of({.cortex_mm = cortex_mm}, fine, is_itself));
    EXPECT_LT(errors.rms, 2.5 * errors.sigma) << cortex_mm;
    EXPECT_GE(errors.sigma, last) << cortex_mm;
    last = errors.sigma;
  }
  EXPECT_GT(last, 0.08);
  EXPECT_LT(last, 0.2);
}

TEST(BoneEdge, IsNotThatOfTheNeighbourBehindANarrowGap) {
  for (const double gap_mm : {2.2, 1.2}) {
    const Rod rod{.outside = [&](double d) { return soft_hu + 1300 * step_down(gap_mm - d, 0.6); }};
    const Errors errors = errors_of(scan_of(rod, fine, is_itself));
    EXPECT_LT(errors.rms, 2 * errors.sigma + 0.05) << gap_mm;
    EXPECT_LT(errors.sigma, 0.25) << gap_mm;
  }
}

TEST(BoneEdge, OfABoneThatTouchesAnotherStaysAtTheOutline) {
  const Rod rod{.cortex_mm = 1, .outside = [](double d) {
                  return spongy_hu + 1100 * (step_down(d - 1.3, 0.6) - step_down(d - 0.3, 0.6));
                }};
  const Errors errors = errors_of(scan_of(rod, fine, is_itself));
  EXPECT_LT(errors.rms, 0.8);
  EXPECT_LT(errors.rms, 2 * errors.sigma);
}

TEST(BoneEdge, BesideAirIsLessCertain) {
  const Rod rod{.outside = [](double) { return -1000.0; }};
  const Errors errors = errors_of(scan_of(rod, fine, is_itself));
  EXPECT_LT(errors.rms, 2 * errors.sigma);
  EXPECT_LT(errors.sigma, 0.2);
}

TEST(BoneEdge, UnderSkinIsNotThatOfTheSkin) {
  const Rod under_air{.outside = [](double d) { return -1000 + 1050 * step_down(d - 2, 0.6); }};
  const Rod under_padding{.outside = [](double d) { return d < 3 ? soft_hu : -3024; }};
  for (const Rod& rod : {under_air, under_padding})
    EXPECT_LT(errors_of(scan_of(rod, fine, is_itself)).rms, 0.15);
}

TEST(BoneEdge, OfACtThatWasCutOutOfItsSoftTissueIsNear) {
  Scan scan = scan_of({}, fine, [](double, double hu) { return hu > 400; });
  for (std::size_t i = 0; i < scan.hu.size(); ++i)
    if (scan.mask.values[i] == 0) scan.hu[i] = -1024;
  const Errors errors = errors_of(scan);
  EXPECT_LT(errors.rms, 2.5 * errors.sigma);
  EXPECT_LT(errors.sigma, 0.15);
}

TEST(BoneEdge, IsNotThatOfMetalBehindTheCortex) {
  Scan scan = scan_of({.cortex_mm = 1.5}, fine, is_itself);
  const double itself = errors_of(scan).mean;
  scan.mask.each([&](const Vector3i& at) {
    if (scan.place(at.cast<double>()).head<2>().norm() < radius_mm - 3.5) scan.hu[scan.mask.index(at)] = 8000;
  });
  EXPECT_NEAR(errors_of(scan).mean, itself, 0.1);
}

TEST(BoneEdge, WithoutContrastIsTheOutline) {
  const Rod rod{.outside = [](double) { return 1300.0; }};
  const Errors errors = errors_of(scan_of(rod, fine, is_itself));
  EXPECT_LT(errors.rms, 0.1);
  EXPECT_GE(errors.sigma, 0.07);
}

TEST(BoneEdge, FarFromTheOutlineIsUncertainByTheRest) {
  const Errors errors = errors_of(scan_of({}, fine, [](double d, double) { return d < 2.2; }));
  EXPECT_NEAR(errors.mean, 0.7, 0.15);
  EXPECT_GT(errors.sigma, 0.5);
}

TEST(BoneEdge, OfAPlateOfOneVoxelRemains) {
  for (const double peak_hu : {50.0, 1300.0}) {
    const Vector3i size(20, 20, 20);
    ByteGrid mask = byte_grid(size);
    std::vector<float> hu(mask.values.size(), 50);
    mask.each([&](const Vector3i& at) {
      if (at.z() != 10) return;
      mask.values[mask.index(at)] = 1;
      hu[mask.index(at)] = static_cast<float>(peak_hu);
    });
    const BoneEdge edge = bone_edge(mask, hu, fine);
    EXPECT_GT(edge.excess({9.5, 9.5, 10}), 0) << peak_hu;
    EXPECT_LT(edge.excess({9.5, 9.5, 8.5}), 0) << peak_hu;
  }
}

TEST(BoneEdge, OfVerySmallVoxelsHasASigma) {
  const Scan scan = scan_of({}, fine, is_itself);
  const BoneEdge edge = bone_edge(scan.mask, scan.hu, 0.01 * Matrix3d::Identity());
  EXPECT_GT(edge.sigma_mm(scan.voxel({radius_mm, 0, 0})), 0);
}

TEST(BoneEdge, OfASingleSliceIsThatOfItsPlane) {
  ByteGrid mask = byte_grid({30, 30, 1});
  std::vector<float> hu(mask.values.size(), 50);
  mask.each([&](const Vector3i& at) {
    if ((at - Vector3i(15, 15, 0)).cast<double>().norm() > 8) return;
    mask.values[mask.index(at)] = 1;
    hu[mask.index(at)] = 1300;
  });
  const BoneEdge edge = bone_edge(mask, hu, Matrix3d::Identity());
  EXPECT_GT(edge.excess({22, 15, 0}), 0);
  EXPECT_LT(edge.excess({25, 15, 0}), 0);
}

TEST(BoneEdge, AnEmptyOutlineHasNone) {
  const Scan scan = scan_of({}, fine, [](double, double) { return false; });
  const BoneEdge edge = bone_edge(scan.mask, scan.hu, fine);
  EXPECT_THAT(edge.inside.values, testing::Each(testing::Lt(127)));
}

}  // namespace
}  // namespace helicarm::volume

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/measure.h"

#include <cmath>

#include <Eigen/Dense>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/measures/drawing.h"
#include "helicarm/measures/measure_json.h"

namespace helicarm::measures {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::HasSubstr;

const Matrix2d half_px = 0.25 * Matrix2d::Identity();

calibration::CalibratedView mirrored_view() {
  calibration::CalibratedView view;
  view.view = {{-3500, 3500, 510, 505, 0}, {geometry::rotation_from_euler(0.4, -0.2, 1.1), {5, -9, 800}}};
  return view;
}

/// Landmarks of a femur; 100 % of depth is 200 px, of height 100 px.
std::vector<Click> femur(const std::vector<Click>& further = {}) {
  std::vector<Click> clicks{{"blumensaat_posterior", {300, 400}, half_px},
                            {"blumensaat_anterior", {460, 280}, half_px},
                            {"inferior", {420, 435}, half_px}};
  clicks.insert(clicks.end(), further.begin(), further.end());
  return clicks;
}

/// Covariance of `values` where the clicks' errors are drawn at random.
Eigen::MatrixXd drawn_covariance(Kind kind, const std::vector<Click>& clicks,
                                 const std::function<Eigen::VectorXd(const Measure&)>& values) {
  constexpr int trials = 20000;
  RandomStream stream(3, 1);
  Eigen::VectorXd sum, none;
  Eigen::MatrixXd squares;
  for (int i = 0; i < trials; ++i) {
    std::vector<Click> moved = clicks;
    for (Click& click : moved) {
      const Matrix2d root = click.covariance_px2.llt().matrixL();
      const double x = stream.normal(), y = stream.normal();
      click.uv += root * Vector2d(x, y);
    }
    const Eigen::VectorXd got = values(measure(kind, moved, {}).value());
    if (i == 0) sum = 0 * got, squares = Eigen::MatrixXd::Zero(got.size(), got.size());
    sum += got;
    squares += got * got.transpose();
  }
  const Eigen::VectorXd mean = sum / trials;
  return squares / trials - mean * mean.transpose();
}

TEST(Distance, IsThatOfPointsInThePlane) {
  const calibration::CalibratedView view = mirrored_view();
  const Vector3d middle(12, -20, 30);
  const Eigen::Matrix3d axes = view.view.camera_from_world.rotation.transpose();  // camera's in the world
  const Vector3d other = middle + 30 * axes.col(0) - 40 * axes.col(1);
  const std::vector<Click> clicks{{"from", view.view.project(middle), half_px},
                                  {"to", view.view.project(other), half_px}};
  const Measure measured = measure(Kind::distance, clicks, plane_through(view, middle).value()).value();
  EXPECT_NEAR(measured.quantities[0].value, 50, 1e-9);
  EXPECT_EQ(measured.quantities[0].unit, "mm");
  EXPECT_NEAR(*measured.depth_mm, view.view.depth(middle), 1e-9);
  const double mm_per_px = view.view.depth(middle) / 3500;
  EXPECT_NEAR(*measured.quantities[0].sigma, std::sqrt(0.5) * mm_per_px, 1e-6);
}

TEST(Distance, IsInPixelsWithoutAPlane) {
  const std::vector<Click> clicks{{"from", {10, 20}, half_px}, {"to", {13, 24}, half_px}};
  const Quantity length = measure(Kind::distance, clicks, {}).value().quantities[0];
  EXPECT_NEAR(length.value, 5, 1e-12);
  EXPECT_EQ(length.unit, "px");
}

TEST(ObjectPlane, SigmaIsThatOfDrawnViewsAndPoints) {
  calibration::CalibratedView view = mirrored_view();
  view.covariance.diagonal() << 9, 9, 16, 16, 1e-6, 2e-6, 3e-6, 0.04, 0.04, 0.5, 0;
  view.covariance(0, 1) = view.covariance(1, 0) = -8.5;  // of a mirrored image, both focal lengths together
  view.covariance(1, 9) = view.covariance(9, 1) = 1.8;
  view.covariance(0, 9) = view.covariance(9, 0) = -1.75;
  const Eigen::Matrix3d of_point = Vector3d(0.2, 0.1, 0.3).asDiagonal();
  const Vector3d point(12, -20, 30);
  const Eigen::Matrix<double, 11, 11> root =
      Eigen::SelfAdjointEigenSolver<calibration::ViewCovariance>(view.covariance).operatorSqrt();
  RandomStream stream(4, 1);
  double sum = 0, squares = 0;
  constexpr int trials = 20000;
  for (int i = 0; i < trials; ++i) {
    Eigen::Vector<double, 11> normal;
    for (double& value : normal) value = stream.normal();
    const Eigen::Vector<double, 11> off = root * normal;
    geometry::View drawn = view.view;
    drawn.intrinsics.fx += off[0], drawn.intrinsics.fy += off[1];
    drawn.camera_from_world.rotation =
        geometry::rotation_from_vector(off.segment<3>(4)) * drawn.camera_from_world.rotation;
    drawn.camera_from_world.translation += off.segment<3>(7);
    const double x = stream.normal(), y = stream.normal(), z = stream.normal();
    const Vector3d at = point + of_point.cwiseSqrt() * Vector3d(x, y, z);
    const double scale = drawn.depth(at) / std::sqrt(-drawn.intrinsics.fx * drawn.intrinsics.fy);
    sum += scale, squares += scale * scale;
  }
  const double mean = sum / trials, sigma = std::sqrt(squares / trials - mean * mean) / mean;
  EXPECT_NEAR(plane_through(view, point, of_point).value().relative_sigma / sigma, 1, 0.03);
}

TEST(ObjectPlane, DepthSigmaIsPartOfALength) {
  const ObjectPlane plane = plane_at(mirrored_view(), 800, 8);
  EXPECT_NEAR(plane.relative_sigma, 0.01, 1e-12);
  const std::vector<Click> clicks{{"from", {0, 0}, Matrix2d::Zero()}, {"to", {350, 0}, Matrix2d::Zero()}};
  const Quantity length = measure(Kind::distance, clicks, plane).value().quantities[0];
  EXPECT_NEAR(length.value, 80, 1e-9);
  EXPECT_NEAR(*length.sigma, 0.8, 1e-9);
}

TEST(FemoralQuadrants, DepthFromPosteriorAndHeightFromBlumensaat) {
  // 50 px along the line of 200 px, 30 of 100 px below it.
  const Vector2d along(0.8, -0.6), under(0.6, 0.8);
  const Measure measured = measure(Kind::femoral_quadrants,
                                   femur({{"FS", Vector2d(300, 400) + 50 * along + 30 * under, half_px}}), {})
                               .value();
  ASSERT_EQ(measured.positions.size(), 1u);
  EXPECT_EQ(measured.positions[0].point, "FS");
  EXPECT_NEAR(measured.positions[0].percent[0], 25, 1e-9);
  EXPECT_NEAR(measured.positions[0].percent[1], 30, 1e-9);
  EXPECT_NEAR(measured.quantities[0].value, 200, 1e-9);
  EXPECT_NEAR(measured.quantities[1].value, 100, 1e-9);
}

TEST(FemoralQuadrants, BordersAgainstTheLineAreRefused) {
  const Vector2d along(0.8, -0.6), line(300, 400);
  const auto exchanged = measure(
      Kind::femoral_quadrants,
      femur({{"posterior", line + 230 * along, half_px}, {"anterior", line - 20 * along, half_px}}), {});
  ASSERT_FALSE(exchanged);
  EXPECT_EQ(exchanged.error().reason, Reason::bad_value);
}

TEST(FemoralQuadrants, BordersReplaceTheEndsOfTheLine) {
  const Vector2d along(0.8, -0.6), line(300, 400);
  const auto at_borders = measure(Kind::femoral_quadrants,
                                  femur({{"posterior", line - 20 * along + Vector2d(6, 8), half_px},
                                         {"anterior", line + 230 * along + Vector2d(6, 8), half_px},
                                         {"FS", line + 105 * along, half_px}}),
                                  {})
                              .value();
  EXPECT_NEAR(at_borders.positions[0].percent[0], 50, 1e-9);
  EXPECT_NEAR(at_borders.positions[0].percent[1], 0, 1e-9);
}

TEST(FemoralQuadrants, CovarianceIsThatOfDrawnClicks) {
  const Matrix2d skewed = (Matrix2d() << 1.5, 0.6, 0.6, 0.8).finished();
  const std::vector<Click> clicks = femur({{"FS", {360, 420}, skewed}});
  const Position told = measure(Kind::femoral_quadrants, clicks, {}).value().positions[0];
  const Eigen::MatrixXd drawn = drawn_covariance(Kind::femoral_quadrants, clicks,
                                                 [](const Measure& m) { return m.positions[0].percent; });
  EXPECT_LT((told.covariance - drawn).norm(), 0.04 * drawn.norm()) << told.covariance << "\n\n" << drawn;
}

TEST(FemoralQuadrants, PerCentAreTheSameInAPlane) {
  const std::vector<Click> clicks = femur({{"FS", {360, 420}, half_px}});
  const Position in_px = measure(Kind::femoral_quadrants, clicks, {}).value().positions[0];
  const Position in_mm =
      measure(Kind::femoral_quadrants, clicks, plane_at(mirrored_view(), 700, 5)).value().positions[0];
  EXPECT_LT((in_px.percent - in_mm.percent).norm(), 1e-9);
  EXPECT_LT((in_px.covariance - in_mm.covariance).norm(), 1e-6);
}

TEST(Tibia, PerCentFromTheAnteriorMargin) {
  const std::vector<Click> margins{{"anterior", {100, 200}, half_px}, {"posterior", {300, 200}, half_px}};
  std::vector<Click> clicks = margins;
  clicks.push_back({"TE", {184.6, 230}, half_px});
  EXPECT_NEAR(measure(Kind::tibia_ap, clicks, {}).value().positions[0].percent[0], 42.3, 1e-9);
  // Along a plateau line that slopes, the same point counts otherwise.
  clicks.push_back({"plateau1", {120, 190}, half_px});
  clicks.push_back({"plateau2", {280, 220}, half_px});
  const Vector2d along = Vector2d(160, 30).normalized();
  const double expected = 100 * Vector2d(84.6, 30).dot(along) / Vector2d(200, 0).dot(along);
  EXPECT_NEAR(measure(Kind::tibia_ap, clicks, {}).value().positions[0].percent[0], expected, 1e-9);
}

TEST(Tibia, SigmaIsThatOfDrawnClicks) {
  const std::vector<Click> clicks{
      {"medial", {100, 200}, half_px}, {"lateral", {180, 214}, 4 * half_px}, {"TE", {150, 190}, half_px}};
  const Position told = measure(Kind::tibia_ml, clicks, {}).value().positions[0];
  const Eigen::MatrixXd drawn =
      drawn_covariance(Kind::tibia_ml, clicks, [](const Measure& m) { return m.positions[0].percent; });
  EXPECT_NEAR(told.covariance(0, 0) / drawn(0, 0), 1, 0.05);
}

TEST(AnglesAndCircle, SigmasAreThoseOfDrawnClicks) {
  const std::vector<Click> at_vertex{
      {"first", {100, 0}, half_px}, {"vertex", {0, 0}, 4 * half_px}, {"second", {30, 80}, half_px}};
  const std::vector<Click> lines{{"line1_from", {0, 0}, half_px},
                                 {"line1_to", {100, 0}, half_px},
                                 {"line2_from", {0, 0}, half_px},
                                 {"line2_to", {50, 90}, half_px}};
  const std::vector<Click> rim{{"rim1", {100, 0}, half_px},
                               {"rim2", {0, 90}, half_px},
                               {"rim3", {-80, 0}, half_px},
                               {"rim4", {5, -85}, half_px}};
  for (const auto& [kind, clicks] :
       {std::pair{Kind::angle, at_vertex}, {Kind::line_angle, lines}, {Kind::circle, rim}}) {
    const double told = *measure(kind, clicks, {}).value().quantities[0].sigma;
    const Eigen::MatrixXd drawn = drawn_covariance(
        kind, clicks, [](const Measure& m) { return Eigen::VectorXd::Constant(1, m.quantities[0].value); });
    EXPECT_NEAR(told / std::sqrt(drawn(0, 0)), 1, 0.03) << info_of(kind).word;
  }
}

TEST(ClickOf, CovarianceIsThatOfDrawnPoints) {
  const geometry::View view = mirrored_view().view;
  const Vector3d point(12, -20, 30), sigma(0.3, 0.1, 0.5);
  const Click click = click_of("FS", point, sigma.cwiseAbs2().asDiagonal(), view).value();
  EXPECT_LT((click.uv - view.project(point)).norm(), 1e-12);
  RandomStream stream(5, 1);
  Matrix2d drawn = Matrix2d::Zero();
  constexpr int trials = 20000;
  for (int i = 0; i < trials; ++i) {
    const double x = stream.normal(), y = stream.normal(), z = stream.normal();
    const Vector2d off = view.project(point + sigma.cwiseProduct(Vector3d(x, y, z))) - click.uv;
    drawn += off * off.transpose() / trials;
  }
  EXPECT_LT((click.covariance_px2 - drawn).norm(), 0.03 * drawn.norm());
  EXPECT_EQ(click_of("FS", {0, 0, -1e6}, Eigen::Matrix3d::Zero(), {}).error().reason, Reason::behind_source);
}

std::string refusal(Kind kind, const std::vector<Click>& clicks) {
  const auto refused = measure(kind, clicks, {});
  EXPECT_TRUE(drawing_of(kind, clicks).empty());
  if (refused) return "accepted";
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  return refused.error().message;
}

TEST(Measure, RefusesMissingUnknownAndRepeatedClicks) {
  EXPECT_THAT(refusal(Kind::distance, {{"from", {1, 2}, half_px}}), HasSubstr("\"to\" is missing"));
  EXPECT_THAT(refusal(Kind::distance, {{"start", {1, 2}, half_px}}), HasSubstr("none of its points"));
  EXPECT_THAT(refusal(Kind::tibia_ml, {{"medial", {1, 2}, half_px}, {"medial", {9, 2}, half_px}}),
              HasSubstr("given twice"));
  EXPECT_THAT(refusal(Kind::femoral_quadrants, femur({{"posterior", {1, 2}, half_px}})),
              HasSubstr("\"anterior\" is missing"));
}

TEST(Measure, RefusesClicksThatDetermineNothing) {
  EXPECT_THAT(refusal(Kind::distance, {{"from", {1, 2}, half_px}, {"to", {1.5, 2}, half_px}}),
              HasSubstr("less than 1 px apart"));
  EXPECT_THAT(refusal(Kind::circle,
                      {{"rim1", {0, 0}, half_px}, {"rim2", {5, 5}, half_px}, {"rim3", {9, 9}, half_px}}),
              HasSubstr("line"));
  EXPECT_THAT(refusal(Kind::tibia_ml, {{"medial", {1, 2}, half_px}, {"lateral", {1, 2}, half_px}}),
              HasSubstr("0 and 100 %"));
  std::vector<Click> flat = femur();
  flat[2].uv = {380, 340};
  EXPECT_THAT(refusal(Kind::femoral_quadrants, flat), HasSubstr("0 and 100 %"));
  // Seen along the plateau's line: it has no direction in the image.
  EXPECT_THAT(refusal(Kind::tibia_ap, {{"anterior", {100, 200}, half_px},
                                       {"posterior", {300, 200}, half_px},
                                       {"plateau1", {150, 190}, half_px},
                                       {"plateau2", {152, 203}, half_px},
                                       {"TE", {180, 210}, half_px}}),
              HasSubstr("the plateau are 13 px apart, must be 20 px or more"));
}

/// Anterior and posterior margin 100 px apart, a point at 20 %.
TEST(Measure, PositionOutsideTheLandmarksIsWarnedOfAndTheExchangedClicksAreNamed) {
  const auto warnings = [](double anterior, double posterior, double point) {
    const std::vector<Click> clicks{{"anterior", {anterior, 0}, half_px},
                                    {"posterior", {posterior, 0}, half_px},
                                    {"FS", {point, 0}, half_px}};
    return measure(Kind::tibia_ap, clicks, {})->positions[0].warnings;
  };
  EXPECT_TRUE(warnings(0, 100, 20).empty());
  EXPECT_TRUE(warnings(0, 100, -0.3).empty());  // within its error
  const auto near = warnings(0, 100, -5);
  ASSERT_EQ(near.size(), 1u);
  EXPECT_EQ(near[0].reason, Reason::outside_reference);
  EXPECT_NEAR(near[0].figures.at("percent"), -5, 1e-9);
  EXPECT_EQ(near[0].message.find("exchanged"), std::string::npos);
  EXPECT_THAT(warnings(20, 100, 0)[0].message, HasSubstr("\"FS\" with \"anterior\" (20.0 %)"));
  EXPECT_THAT(warnings(0, 20, 100)[0].message, HasSubstr("\"FS\" with \"posterior\" (20.0 %)"));
}

TEST(Drawing, GridOfQuartersStartsAtTheLine) {
  const auto grid = drawing_of(Kind::femoral_quadrants, femur());
  ASSERT_EQ(grid.size(), 10u);
  EXPECT_LT((grid[1].path[0] - Vector2d(300, 400)).norm(), 1e-9);
  EXPECT_LT((grid[1].path[1] - Vector2d(460, 280)).norm(), 1e-9);
  EXPECT_LT((grid[9].path[0] - Vector2d(360, 480)).norm(), 1e-9);
  EXPECT_EQ(std::ranges::count(grid, true, &Stroke::is_fine), 6);
}

TEST(Sentence, NamesValueUnitAndSigma) {
  EXPECT_EQ(sentence_of(Quantity{"condyle_depth", "mm", 43.217, 0.125}),
            "condyle depth 43.22 mm, sigma 0.12");
  EXPECT_EQ(sentence_of(Quantity{"residual_rms", "px", 0.5, {}}), "residual rms 0.50 px");
  const Position position{"FS", Vector2d(24.8, 28.5), Vector2d(0.25, 1).asDiagonal().toDenseMatrix()};
  EXPECT_EQ(sentence_of(Kind::femoral_quadrants, position),
            "FS depth 24.8 %, sigma 0.5; height 28.5 %, sigma 1.0");
}

}  // namespace
}  // namespace helicarm::measures

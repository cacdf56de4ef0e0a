// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_maps.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/calibration/c_arm_position.h"
#include "helicarm/core/random.h"
#include "helicarm/rectification/fit_map.h"

namespace helicarm::calibration {
namespace {

using Eigen::Vector2d;

constexpr int side = 512;

/// An intensifier in the earth's field: its S distortion follows the field along the central ray, its shear
/// and a quadratic part the field across it.
struct Intensifier {
  explicit Intensifier(std::uint64_t seed) {
    RandomStream random{seed, 0};
    field = Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
  }

  HistoryEntry at(double primary_deg, double secondary_deg, int size = side) const {
    const Eigen::Vector3d ray = *c_arm_direction(primary_deg, secondary_deg);
    const double along = field.dot(ray), across = field.cross(ray).x();
    RandomStream random{std::uint64_t(1000 * (primary_deg + 400) + secondary_deg + 90), 1};
    std::vector<rectification::Correspondence> dots;
    const Vector2d middle = Vector2d::Constant((size - 1) / 2.0);
    for (int i = -8; i <= 8; ++i)
      for (int j = -8; j <= 8; ++j) {
        const Vector2d mm(13.0 * i, 13.0 * j), t = mm / 104;
        const double r2 = t.squaredNorm();
        Vector2d raw = middle + 2.3 * size / side * mm + 6 * r2 * t +
                       1.2 * along * r2 * Vector2d(-t.y(), t.x()) +
                       0.5 * across * Vector2d(t.x() * t.x(), t.x() * t.y());
        raw += 0.03 * Vector2d(random.normal(), random.normal());
        dots.push_back({mm, raw, 0.03});
      }
    HistoryEntry recorded;
    recorded.plate = PlateMap{value_or_throw(rectification::fit_map(dots, size, size, {})).map, 330};
    recorded.estimate_mm = {1000, 0, 0};
    recorded.information.setIdentity();
    recorded.primary_deg = primary_deg;
    recorded.secondary_deg = secondary_deg;
    return recorded;
  }
  std::vector<HistoryEntry> around(const std::vector<double>& primary_deg) const {
    std::vector<HistoryEntry> maps;
    for (const double angle : primary_deg) maps.push_back(at(angle, 0));
    return maps;
  }

  Eigen::Vector3d field;
};

Eigen::MatrixX2d off(const rectification::DistortionMap& a, const rectification::DistortionMap& b,
                     const rectification::MapField& field) {
  return displacements(a, field) - displacements(b, field);
}

double rms(const Eigen::MatrixX2d& of) { return std::sqrt(of.squaredNorm() / double(of.size())); }

const std::vector<double> steps_deg{-90, -60, -30, 0, 30, 60, 90};

TEST(CArmMaps, BetweenRecordedPositionsIsNearerThanOneMapForAll) {
  double by_position = 0, by_one = 0;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const Intensifier intensifier(seed);
    const CArmMaps model = c_arm_maps(intensifier.around(steps_deg)).value();
    const rectification::DistortionMap truth = intensifier.at(15, 0).plate->map;
    by_position += rms(off(map_at(model, 15, 0), truth, model.field));
    by_one += rms(off(map_at(model, {}, {}), truth, model.field));
  }
  EXPECT_LT(by_position, 0.3 * by_one);
}

TEST(CArmMaps, StatedErrorsHold) {
  double inside = 0, count = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const Intensifier intensifier(seed);
    const CArmMaps model = c_arm_maps(intensifier.around(steps_deg)).value();
    for (const double angle : {-75.0, -20.0, 10.0, 50.0, 110.0}) {
      const rectification::DistortionMap map = map_at(model, angle, 0);
      const Eigen::MatrixX2d errors = off(map, intensifier.at(angle, 0).plate->map, model.field);
      const Eigen::VectorXd sigmas = map.covariance_px2(model.field.places).diagonal().cwiseSqrt();
      for (Eigen::Index i = 0; i < errors.rows(); ++i)
        for (int axis = 0; axis < 2; ++axis) inside += std::abs(errors(i, axis)) < 1.96 * sigmas[i];
      count += double(errors.size());
    }
  }
  EXPECT_GT(inside / count, 0.9);
}

TEST(CArmMaps, FartherFromRecordedPositionsErrorsAreLarger) {
  const CArmMaps model = c_arm_maps(Intensifier(1).around(steps_deg)).value();
  const Vector2d edge = model.field.places.back();
  const double between = map_at(model, 15, 0).sigma_px(edge), beyond = map_at(model, 150, 0).sigma_px(edge),
               unknown = map_at(model, {}, {}).sigma_px(edge);
  EXPECT_LT(between, 0.7 * beyond);
  EXPECT_LE(beyond, 1.01 * unknown);
}

TEST(CArmMaps, OfOneMapIsThatMapWithUsualErrors) {
  const Intensifier intensifier(1);
  const CArmMaps model = c_arm_maps(intensifier.around({0})).value();
  EXPECT_TRUE(leave_one_out(model).empty());
  const rectification::DistortionMap there = map_at(model, 0, 0), elsewhere = map_at(model, 90, 0);
  EXPECT_LT(rms(off(there, model.entries[0].plate->map, model.field)), 5e-3);
  const Vector2d edge = model.field.places.back();
  EXPECT_GT(elsewhere.sigma_px(edge), 3 * there.sigma_px(edge));
}

TEST(CArmMaps, EachMapIsCheckedByTheOthers) {
  const CArmMaps model = c_arm_maps(Intensifier(2).around(steps_deg)).value();
  const std::vector<MapCheck> checks = leave_one_out(model);
  ASSERT_EQ(checks.size(), steps_deg.size());
  const MapCheck& middle = checks[3];
  EXPECT_LT(middle.error_px, 0.5 * middle.of_one_map_px);
  EXPECT_LT(middle.error_px, 3 * middle.predicted_px);
}

TEST(CArmMaps, WithoutMapsThereIsNoModel) { EXPECT_FALSE(c_arm_maps(std::vector<HistoryEntry>(3))); }

CArmCheck checked(const Intensifier& recorded, const Intensifier& acquired) {
  const CArmPrior unknown{IntrinsicsVariation{10, 1}, IntrinsicsVariation{10, 3}};
  const CArmModel model = c_arm_model(recorded.around(steps_deg), {1000, 0, 0}, unknown);
  return check_c_arm(model, acquired.around({15, 45}), {});
}

TEST(CArmMaps, AnotherDistortionIsAChangeOfTheCArm) {
  const CArmCheck same = checked(Intensifier(1), Intensifier(1)),
                  other = checked(Intensifier(1), Intensifier(3));
  ASSERT_EQ(same.maps.size(), 2u);
  EXPECT_FALSE(same.maps[0].is_changed || same.maps[1].is_changed);
  EXPECT_TRUE(other.maps[0].is_changed || other.maps[1].is_changed);
}

TEST(CArmMaps, ManyMapsOfOnePositionDoNotPushOutTheOthers) {
  const Intensifier intensifier(1);
  std::vector<HistoryEntry> entries = intensifier.around({0, 45, 90});
  for (int day = 0; day < 80; ++day) entries.push_back(entries[0]);
  const auto kept = c_arm_maps(entries)->entries;
  ASSERT_EQ(kept.size(), 6u);  // the latest four at 0 degrees, and two others
  EXPECT_EQ(kept[0].primary_deg, 45);
  EXPECT_EQ(kept[1].primary_deg, 90);
}

TEST(CArmMaps, MapsThatAreNotComparedAreNamed) {
  const Intensifier intensifier(1);
  const CArmPrior unknown{IntrinsicsVariation{10, 1}, IntrinsicsVariation{10, 3}};
  const CArmModel model = c_arm_model(intensifier.around(steps_deg), {1000, 0, 0}, unknown),
                  few = c_arm_model(intensifier.around({0, 30, 60}), {1000, 0, 0}, unknown);
  HistoryEntry other_field = intensifier.at(15, 0, 2 * side), same_field = intensifier.at(15, 0);
  other_field.view = "magnified";
  same_field.view = "AP";
  const CArmCheck check = check_c_arm(model, std::vector{other_field, same_field}, {});
  EXPECT_EQ(check.uncompared_maps, std::vector<std::string>{"magnified"});
  EXPECT_EQ(check.maps.size(), 1u);
  EXPECT_EQ(check_c_arm(few, std::vector{same_field}, {}).uncompared_maps, std::vector<std::string>{"AP"});
}

TEST(CArmMaps, OfARecordsMapsOnlyThoseThatCountInTheirFieldAreKept) {
  const Intensifier intensifier(1);
  CArmHistory history{intensifier.around({0, 45})};
  history.entries.push_back(intensifier.at(0, 0, 2 * side));
  for (int day = 0; day < 6; ++day) history.entries.push_back(history.entries[0]);
  const CArmMaps before = c_arm_maps(history.entries).value();
  forget_old_maps(history);
  EXPECT_EQ(std::ranges::count_if(history.entries, [](const HistoryEntry& e) { return e.plate.has_value(); }),
            6);  // four at 0 degrees, one at 45, one of the other field
  EXPECT_FALSE(history.entries[0].plate);
  EXPECT_TRUE(history.entries[1].plate && history.entries[2].plate);
  EXPECT_EQ(history.entries.size(), 9u);
  EXPECT_EQ(c_arm_maps(history.entries)->displacements, before.displacements);
}

TEST(CArmMaps, AnEntryWithoutItsMapTakesItWhenAddedAgain) {
  CArmHistory history{Intensifier(1).around({0})};
  const std::vector<HistoryEntry> again = history.entries;
  history.entries[0].plate.reset();
  EXPECT_EQ(add_entries(history, again), 0u);
  EXPECT_TRUE(history.entries[0].plate);
}

TEST(CArmMaps, LeftOutMapsAreOffAsFarAsNewOnes) {
  double left_out = 0, fresh = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Intensifier intensifier(seed);
    const CArmMaps five = c_arm_maps(intensifier.around({-60, -30, 0, 30, 60})).value(),
                   four = c_arm_maps(intensifier.around({-60, -30, 30, 60})).value();
    left_out += leave_one_out(five)[2].error_px;
    fresh += check_map(four, intensifier.at(0, 0)).error_px;
  }
  EXPECT_NEAR(left_out, fresh, 0.02 * fresh);
}

TEST(CArmMaps, MapsOfAnotherImageSizeAreLeftOut) {
  const Intensifier intensifier(1);
  std::vector<HistoryEntry> maps = intensifier.around({0, 30});
  maps.insert(maps.begin(), intensifier.at(0, 0, 2 * side));
  EXPECT_EQ(c_arm_maps(maps)->entries.size(), 2u);
}

}  // namespace
}  // namespace helicarm::calibration

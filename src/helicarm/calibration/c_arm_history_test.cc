// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_history.h"

#include <thread>

#include <Eigen/Cholesky>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/calibration/c_arm_history_file.h"
#include "helicarm/calibration/views_test.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::calibration {
namespace {

using Eigen::Vector3d;

constexpr double px_per_mm = 1 / 0.15;
const Vector3d nominal(900, 0, 0);
const CArmPrior unknown{IntrinsicsVariation{10, 1.4}, IntrinsicsVariation{7, 4.2}};

/// An acquisition with the given focal length and principal point (mm from the image's centre).
ViewFiducials acquisition_with(const Vector3d& intrinsics_mm, bool mirrored, RandomStream& random) {
  geometry::View view = paper_view(6 * random.uniform());
  const double hand = mirrored ? -1 : 1;
  view.intrinsics = {hand * px_per_mm * intrinsics_mm.x(), px_per_mm * intrinsics_mm.x(),
                     512 + hand * px_per_mm * intrinsics_mm.y(), 512 + px_per_mm * intrinsics_mm.z(), 0};
  ViewFiducials seen = observed_fiducials("AP", view, 0.05, random);
  seen.prior = {px_per_mm * nominal.x(), Eigen::Vector2d(512, 512), px_per_mm,
                geometry::NormalPrior{1, 1e-3}};
  return seen;
}

Vector3d scattered_about(const Vector3d& mean, const Vector3d& sigma, RandomStream& random) {
  return mean + sigma.cwiseProduct(normal_3(random));
}

TEST(HistoryEntryOf, EstimateIsConsistentWithTheTruthWithoutThePrior) {
  const Vector3d truth(912, -9, 8);  // far from nominal, so that a remaining prior shows
  double distance2 = 0;
  const int trials = 200;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(31, 0, std::uint64_t(trial));
    const auto entry = history_entry_of(acquisition_with(truth, trial % 2, random), "a", {unknown});
    ASSERT_TRUE(entry.has_value());
    const Vector3d error = entry->estimate_mm - truth;
    distance2 += error.dot(entry->information * error) / trials;
  }
  EXPECT_NEAR(distance2, 3, 0.6);
}

TEST(LearnIntrinsics, EmptyHistoryGivesTheNominalPrior) {
  const LearnedIntrinsics known = learn_intrinsics({}, nominal, unknown);
  EXPECT_EQ(known.mean_mm(), nominal);
  EXPECT_EQ(known.deviation.prior.focal->common, unknown.focal->common);
}

TEST(LearnIntrinsics, SingularInformationChangesNothing) {
  const std::vector<HistoryEntry> entries{{"a", "AP", {950, 5, 5}, 1e-200 * Eigen::Matrix3d::Identity()}};
  EXPECT_TRUE(learn_intrinsics(entries, nominal, unknown).mean_mm().isApprox(nominal, 1e-12));
}

TEST(LearnIntrinsics, CovarianceOfTheNextAcquisitionIsConsistent) {
  double distance2 = 0, focal_sigma = 0;
  const int trials = 100;
  for (int trial = 0; trial < trials; ++trial) {
    RandomStream random(32, 0, std::uint64_t(trial));
    const Vector3d mean = scattered_about(nominal, {10, 7, 7}, random);
    const Vector3d sag(1.4, 4.2, 4.2);
    std::vector<HistoryEntry> entries;
    for (int k = 0; k < 12; ++k)
      entries.push_back(*history_entry_of(acquisition_with(scattered_about(mean, sag, random), false, random),
                                          "a", {unknown}));
    const LearnedIntrinsics known = learn_intrinsics(entries, nominal, unknown);
    const Vector3d next = scattered_about(mean, sag, random) - known.mean_mm();
    const double focal =
        std::hypot(known.deviation.prior.focal->common, known.deviation.prior.focal->of_view);
    const double principal =
        std::hypot(known.deviation.prior.principal->common, known.deviation.prior.principal->of_view);
    distance2 +=
        (next.x() * next.x() / focal / focal + next.tail<2>().squaredNorm() / principal / principal) / trials;
    focal_sigma += focal / trials;
  }
  EXPECT_NEAR(distance2, 3, 0.8);
  EXPECT_LT(focal_sigma, 2.5);  // of 10 mm beforehand
}

TEST(LearnedPrior, IsMovedByTheDeviationReflectedForAMirroredImage) {
  const Vector3d known(5, 4, -2);
  const geometry::IntrinsicsPrior prior{900 * px_per_mm, Eigen::Vector2d(512, 512), px_per_mm};
  EXPECT_NEAR(*learned_prior(prior, known, false).focal_px, 905 * px_per_mm, 1e-9);
  EXPECT_NEAR(learned_prior(prior, known, false).principal_px->x(), 512 + 4 * px_per_mm, 1e-9);
  EXPECT_NEAR(learned_prior(prior, known, true).principal_px->x(), 512 - 4 * px_per_mm, 1e-9);
}

TEST(CArmHistoryJson, RoundTrip) {
  RandomStream random(33, 0);
  const CArmHistory history{
      {*history_entry_of(acquisition_with({905, 1, 2}, false, random), "digest", {unknown})}};
  const auto again = history_from_json(to_json(history), "machine.json");
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again->entries.at(0).image, "digest");
  EXPECT_EQ(again->entries[0].estimate_mm, history.entries[0].estimate_mm);
  EXPECT_TRUE(again->entries[0].information.isApprox(history.entries[0].information));
}

TEST(CArmHistoryJson, KeepsAMapWithItsField) {
  HistoryEntry entry{"a", "AP", {901, 2, 3}, Eigen::Matrix3d::Identity()};
  entry.plate = PlateMap{rectification::identity_map(512, 384, 0.3), 250};
  Json json = to_json(CArmHistory{{entry}});
  const HistoryEntry read = history_from_json(json, "machine.json").value().entries.at(0);
  ASSERT_TRUE(read.plate);
  EXPECT_EQ(read.plate->map.height, 384);
  EXPECT_EQ(read.plate->field_radius_px, 250);
  json["shots"][0].erase("field_radius_px");
  EXPECT_EQ(history_from_json(json, "machine.json").error().reason, Reason::bad_value);
}

TEST(CArmHistoryJson, KeepsTheErrorsOfTheCalibrator) {
  HistoryEntry entry{"a", "AP", {901, 2, 3}, Eigen::Matrix3d::Identity()};
  entry.nominal_focal_mm = 900;
  entry.calibrator = "digest";
  entry.by_calibrator = 0.5 * Eigen::Matrix3d::Identity();
  Json json = to_json(CArmHistory{{entry}});
  const HistoryEntry read = history_from_json(json, "machine.json").value().entries.at(0);
  EXPECT_EQ(read.nominal_focal_mm, 900);
  EXPECT_EQ(read.calibrator, "digest");
  EXPECT_EQ(read.by_calibrator, entry.by_calibrator);
  json["shots"][0]["by_calibrator"][1][1] = 1.5;  // more than the covariance
  EXPECT_EQ(history_from_json(json, "machine.json").error().reason, Reason::bad_value);
  json["shots"][0].erase("by_calibrator");
  EXPECT_EQ(history_from_json(json, "machine.json").error().reason, Reason::bad_value);
}

TEST(CArmHistoryJson, ARunsIsocentreIsAddedOnce) {
  const HistoryEntry entry{"a", "RUN/1", {901, 2, 3}, Eigen::Vector3d(1, 2, 3).asDiagonal()};
  const Json path{{"arc_deg", 200.5},
                  {"isocentre_radius_mm", 1.25},
                  {"isocentre_sigma_mm", {0.1, 0.2, 0.3}},
                  {"source_to_axis_mm", 620}};
  const Json frames{{{"decision", "accept"}}, {{"decision", "refuse"}}, {{"decision", "warn"}}};
  const Json sweep{{"format", "helicarm-sweep/1"},
                   {"acquisitions", acquisitions_json({entry})},
                   {"path", path},
                   {"frames", frames}};
  const auto run = isocentre_of_result(sweep, "sweep.json").value();
  ASSERT_TRUE(run);
  const TemporaryFolder folder;
  for (int time = 0; time < 2; ++time)
    ASSERT_TRUE(add_to_history(folder.path() / "arm.json", std::vector{entry}, run));
  const CArmHistory read = read_history(folder.path() / "arm.json").value();
  ASSERT_EQ(read.runs.size(), 1u);
  EXPECT_EQ(read.runs[0].images, 2);
  EXPECT_EQ(read.runs[0].radius_mm, 1.25);
  EXPECT_EQ(read.runs[0].sigma_mm.z(), 0.3);
  EXPECT_FALSE(read.runs[0].date.empty());
  EXPECT_FALSE(isocentre_of_result({{"format", "helicarm-result/1"}}, "result.json").value());
}

Json result_with(const std::vector<HistoryEntry>& entries) {
  return {{"format", "helicarm-result/1"}, {"status", "ok"}, {"acquisitions", acquisitions_json(entries)}};
}

TEST(CArmHistoryJson, AResultsAcquisitionsAreThoseThatWereWritten) {
  HistoryEntry entry{"a", "AP", {901, 2, 3}, Eigen::Vector3d(1, 2, 3).asDiagonal()};
  entry.primary_deg = -30;
  const auto read = acquisitions_of_result(result_with({entry}), "result.json");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 1U);
  EXPECT_EQ(read->front().image, "a");
  EXPECT_EQ(read->front().estimate_mm, entry.estimate_mm);
  EXPECT_EQ(read->front().information, entry.information);
  EXPECT_EQ(read->front().primary_deg, -30);
  EXPECT_FALSE(read->front().secondary_deg);
}

TEST(CArmHistoryJson, AResultWithoutAcquisitionsSaysSo) {
  EXPECT_EQ(acquisitions_of_result(result_with({}), "result.json").error().reason, Reason::too_few_views);
  Json refused = result_with({});
  refused["status"] = "refused";
  EXPECT_EQ(acquisitions_of_result(refused, "result.json").error().reason, Reason::too_few_views);
  EXPECT_EQ(acquisitions_of_result({{"format", "helicarm-case/2"}}, "case.json").error().reason,
            Reason::bad_value);
}

TEST(CArmHistoryFile, AdditionsAtTheSameTimeAreAllKept) {
  const TemporaryFolder temporary;
  const std::filesystem::path file = temporary.path() / "new" / "machine.json";
  {
    std::vector<std::jthread> runs;
    for (int run = 0; run < 6; ++run)
      runs.emplace_back([&, run] {
        const HistoryEntry entry{fmt::format("image {}", run), "AP", nominal, Eigen::Matrix3d::Identity()};
        const HistoryEntry same{"image of all", "LAT", nominal, Eigen::Matrix3d::Identity()};
        EXPECT_TRUE(add_to_history(file, std::vector{entry, same}));
      });
  }
  EXPECT_EQ(read_history(file)->entries.size(), 7u);
  const auto again = add_to_history(file, read_history(file)->entries);
  EXPECT_EQ(again->earlier, 7u);
  EXPECT_EQ(again->added, 0u);
}

TEST(CArmHistoryFile, AcquisitionsHaveTheDayThatIsTold) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "arm.json";
  const HistoryEntry entry{"a", "AP", {901, 2, 3}, Eigen::Matrix3d::Identity()};
  ASSERT_TRUE(add_to_history(file, std::vector{entry}, {}, "2024-02-29"));
  EXPECT_EQ(read_history(file)->entries.front().date, "2024-02-29");
  for (const char* date : {"2023-02-29", "29.02.2024", "2024-2-29", "2024-02-29T10", "9999-01-01", ""})
    EXPECT_EQ(add_to_history(file, std::vector{entry}, {}, date).error().reason, Reason::bad_value) << date;
}

TEST(CArmHistoryFile, ThatCannotBeWrittenIsRefusedBeforehand) {
  const TemporaryFolder temporary;
  EXPECT_EQ(check_history_file(temporary.path()).error().reason, Reason::cannot_write);
  EXPECT_EQ(check_history_file("/dev/null/machine.json").error().reason, Reason::cannot_write);
  EXPECT_TRUE(check_history_file(temporary.path() / "machine.json"));
  EXPECT_TRUE(std::filesystem::is_empty(temporary.path()));
}

TEST(CArmHistoryJson, IndefiniteInformationIsRefused) {
  RandomStream random(34, 0);
  Json json = to_json(
      CArmHistory{{*history_entry_of(acquisition_with({905, 1, 2}, false, random), "digest", {unknown})}});
  json["shots"][0]["information_per_mm2"][0][0] = -1;
  EXPECT_EQ(history_from_json(json, "machine.json").error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::calibration

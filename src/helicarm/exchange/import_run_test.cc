// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "helicarm/core/json.h"
#include "helicarm/exchange/import_text_test.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::exchange {
namespace {

/// Images of a rotation; with `mirrored` all of them are.
RunGeometry rotation_run(bool mirrored) {
  RunGeometry run{{}, {640, 480}, 0.4};
  for (int i = 0; i < 3; ++i) {
    const double fy = 2500 + 3.25 * i;
    run.images.push_back(
        {fmt::format("RUN/{}", i + 1),
         {{mirrored ? -1.01 * fy : 1.01 * fy, fy, 322.125 + i, 238.5 - 2 * i, 0},
          {geometry::rotation_from_vector({1.4 + 0.1 * i, 0.7 * i, 0.2}), {3, -4.5, 620 + i / 3.0}}}});
  }
  return run;
}

/// Relative difference of the projections, up to scale.
void expect_read_back(const Expected<std::vector<ImportedMatrix>>& read, const RunGeometry& run,
                      const std::string& format) {
  ASSERT_TRUE(read) << format << ": " << read.error().message;
  ASSERT_EQ(read->size(), run.images.size()) << format;
  for (std::size_t i = 0; i < read->size(); ++i) {
    const geometry::Projection given = run.images[i].view.projection().normalized();
    const geometry::Projection back = (*read)[i].view.projection().normalized();
    EXPECT_LT((given - back).cwiseAbs().maxCoeff(), 1e-9) << format << " image " << i;
    EXPECT_EQ((*read)[i].view.intrinsics.fx < 0, run.images[i].view.intrinsics.fx < 0) << format;
  }
}

Expected<std::vector<ImportedMatrix>> cameras_in(const std::string& text, const ImportOptions& options = {}) {
  return import_cameras(WrittenFile(text).path, options);
}

class ImportedRuns : public testing::TestWithParam<bool> {};

TEST_P(ImportedRuns, AreTheViewsThatWereWritten) {
  const RunGeometry run = rotation_run(GetParam());
  const ImportOptions sized{.image_size = run.size};
  expect_read_back(cameras_in(astra_vectors(run), sized), run, "astra");
  expect_read_back(cameras_in(*leap_modular(run)), run, "leap");
  expect_read_back(cameras_in(*tigre_geometry(run)), run, "tigre");
  expect_read_back(cameras_in(*diffdrr_cameras(run)), run, "diffdrr");
  expect_read_back(cameras_in(deepdrr_cameras(run)), run, "deepdrr");
  expect_read_back(cameras_in(ompl_matrices(run)), run, "ompl");
  expect_read_back(cameras_in(matrices_csv(run)), run, "csv");
  expect_read_back(cameras_in(matrices_npy(run)), run, "npy");
  // RTK's rows run upwards where the image is not mirrored; the comment states it, and the option may.
  expect_read_back(cameras_in(*rtk_geometry(run)), run, "rtk");
  expect_read_back(cameras_in(*rtk_geometry(run), {.image_size = run.size, .rows_upwards = !GetParam()}), run,
                   "rtk");
}

INSTANTIATE_TEST_SUITE_P(Handedness, ImportedRuns, testing::Bool());

TEST(ImportRun, NamesAndSizesAreThoseOfTheFile) {
  const RunGeometry run = rotation_run(false);
  EXPECT_EQ(cameras_in(matrices_csv(run))->at(1).name, "RUN/2");
  EXPECT_EQ(cameras_in(*diffdrr_cameras(run))->at(2).name, "RUN/3");
  EXPECT_EQ(cameras_in(*leap_modular(run))->at(0).image_size, run.size);
  EXPECT_FALSE(cameras_in(matrices_csv(run))->at(0).image_size);
  EXPECT_EQ(cameras_in(matrices_csv(run), {.image_size = run.size})->at(0).image_size, run.size);
  EXPECT_EQ(cameras_in(*leap_modular(run), {.image_size = Eigen::Vector2i(640, 400)}).error().reason,
            Reason::bad_size);
}

TEST(ImportRun, PlastimatchsFolderIsARunInTheOrderOfItsNames) {
  const RunGeometry run = rotation_run(false);
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("helicarm_pm_{}", ::getpid());
  for (std::size_t i = 0; i < run.images.size(); ++i)
    ASSERT_TRUE(write_file(folder / fmt::format("{:04d}.txt", i + 1),
                           plastimatch_matrix(run.images[i].view, run.pixel_mm)));
  const auto read = import_cameras(folder);
  const auto chosen = import_cameras(folder, {.column = 2});
  ASSERT_TRUE(write_file(folder / "0009.txt", ompl_matrices(run)));
  const auto mixed = import_cameras(folder);
  std::filesystem::remove_all(folder);
  expect_read_back(read, run, "plastimatch");
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->at(0).name, "0002");
  EXPECT_EQ(mixed.error().reason, Reason::unsupported);
}

TEST(ImportRun, OneCameraOfSeveralIsChosenByItsColumn) {
  const RunGeometry run = rotation_run(false);
  const std::string text = matrices_csv(run);
  EXPECT_EQ(import_text(text).error().reason, Reason::usage);
  EXPECT_EQ(import_text(text, {.column = 4}).error().reason, Reason::bad_value);
  const auto third = import_text(text, {.column = 3});
  ASSERT_TRUE(third);
  EXPECT_NEAR(third->view.intrinsics.fy, run.images[2].view.intrinsics.fy, 1e-6);
}

TEST(ImportRun, ANameOfATableMayHoldCommasAndQuotes) {
  RunGeometry run = rotation_run(false);
  run.images[0].name = "AP, 20 deg";
  run.images[1].name = "the \"oblique\", one";
  const std::string text = matrices_csv(run);
  EXPECT_NE(text.find("\n\"AP, 20 deg\","), std::string::npos);
  expect_read_back(cameras_in(text), run, "csv");
  const auto read = cameras_in(text);
  ASSERT_TRUE(read) << read.error().message;
  for (std::size_t i = 0; i < run.images.size(); ++i) EXPECT_EQ(read->at(i).name, run.images[i].name);
  EXPECT_EQ(cameras_in(text + "\"RUN/4,1,2\n").error().reason, Reason::truncated);
  EXPECT_EQ(cameras_in(text + "\"RUN/4\" 1,2\n").error().reason, Reason::bad_size);
}

TEST(ImportRun, WhatAFormatDoesNotHoldIsAskedFor) {
  const RunGeometry run = rotation_run(false);
  EXPECT_EQ(cameras_in(astra_vectors(run)).error().reason, Reason::usage);
  std::string bare;
  for (const char* line : {"1 0 0 0 0 1 0 0 0 0 1 700\n", "1 0 0 0 0 1 0 0 0 0 1 710\n"}) bare += line;
  EXPECT_EQ(cameras_in(bare).error().reason, Reason::usage);
  EXPECT_EQ(cameras_in(bare, {.rows = RowKind::matrix})->size(), 2u);
  EXPECT_EQ(cameras_in(astra_vectors(run), {.image_size = run.size, .rows = RowKind::matrix}).error().reason,
            Reason::bad_value);
  EXPECT_EQ(cameras_in(matrices_csv(run), {.rows_upwards = true}).error().reason, Reason::usage);
}

/// The spacing of its comment, unless the option contradicts it.
TEST(ImportRun, RtksCommentStatesItsPixels) {
  const RunGeometry run = rotation_run(true);
  const std::string text = *rtk_geometry(run);
  expect_read_back(cameras_in(text), run, "rtk");
  ImportOptions options;
  options.pixel_mm = {0.4, 0.5};
  EXPECT_EQ(cameras_in(text, options).error().reason, Reason::bad_value);
}

TEST(ImportRun, AFormatInMmTakesNoOtherUnit) {
  const RunGeometry run = rotation_run(true);
  for (const std::string& text : {*leap_modular(run), *tigre_geometry(run), *diffdrr_cameras(run),
                                  deepdrr_cameras(run), *rtk_geometry(run)}) {
    EXPECT_EQ(cameras_in(text, {.mm_per_unit = 10}).error().reason, Reason::bad_value) << text.substr(0, 60);
    EXPECT_TRUE(cameras_in(text, {.mm_per_unit = 1})) << text.substr(0, 60);
  }
}

TEST(ImportRun, RowsThatRtksCommentHasTheOtherWayAreRefused) {
  const std::string text = *rtk_geometry(rotation_run(true));  // mirrored: the first row is at the top
  EXPECT_EQ(cameras_in(text, {.rows_upwards = true}).error().reason, Reason::bad_value);
}

TEST(ImportRun, LeapsObliqueRowsAreRefused) {
  RunGeometry run = rotation_run(false);
  run.images.resize(1);
  Json json = *parse_json(*leap_modular(run), "leap.json");
  const auto vector = [&](const char* key) {
    return Eigen::Vector3d(json[key][0].get<std::vector<double>>().data());
  };
  const Eigen::Vector3d oblique = (vector("rowVectors") + 0.01 * vector("colVectors")).normalized();
  json["rowVectors"][0] = {oblique.x(), oblique.y(), oblique.z()};
  EXPECT_EQ(cameras_in(to_text(json)).error().reason, Reason::bad_value);
}

TEST(ImportRun, BrokenFilesAreNamed) {
  const RunGeometry run = rotation_run(false);
  const std::string leap = *leap_modular(run), tigre = *tigre_geometry(run), npy = matrices_npy(run),
                    drr = *diffdrr_cameras(run), csv = matrices_csv(run),
                    pm = plastimatch_matrix(run.images[0].view, 0.4);
  for (const auto& [text, reason] :
       {std::pair{replaced(leap, "\"numAngles\": 3", "\"numAngles\": 4"), Reason::bad_size},
        {replaced(leap, "\"numAngles\"", "\"tilt\": 0, \"numAngles\""), Reason::unknown_key},
        {replaced(tigre, "\"COR\": 0", "\"COR\": 1"), Reason::unsupported},
        {replaced(tigre, "cone", "parallel"), Reason::bad_value},
        {npy.substr(0, npy.size() - 1), Reason::truncated},
        {npy + "x", Reason::bad_size},
        {replaced(npy, "<f8", "<i8"), Reason::unsupported},
        {replaced(npy, "(3, 3, 4)", "(3, 4, 4)"), Reason::bad_size},
        {replaced(drr, "reverse_x_axis", "reverse_axis"), Reason::truncated},
        {csv.substr(0, csv.find('\n') + 1), Reason::truncated},
        {csv + "RUN/4,1,2\n", Reason::bad_size},
        {pm.substr(0, pm.size() - 12), Reason::truncated},
        {replaced(pm, "Intrinsic\n", "Intrinsic\n1"), Reason::bad_value}}) {
    const auto refused = cameras_in(text);
    ASSERT_FALSE(refused) << text.substr(0, 200);
    EXPECT_EQ(refused.error().reason, reason) << refused.error().message;
  }
}

}  // namespace
}  // namespace helicarm::exchange

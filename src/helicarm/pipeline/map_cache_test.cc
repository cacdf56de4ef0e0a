// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/map_cache.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/image/png.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  if (!fs::exists(folder)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) files.push_back(entry.path());
  return files;
}

class MapCache : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder();
    simulation::SimulationOptions options;
    options.size = 512;
    const auto simulated = simulation::simulate_case(options);
    ASSERT_TRUE(simulated);
    ASSERT_TRUE(simulation::write_case(folder_->path() / "case", *simulated));
    given_ = new Case(*read_case(folder_->path() / "case"));
  }
  static void TearDownTestSuite() {
    delete given_;
    delete folder_;
  }

  CaseView view() const {
    CaseView view = given_->views.front();
    view.plate_image = view.image;
    return view;
  }
  fs::path cache() const { return folder_->path() / "new" / "cache"; }
  void TearDown() override { fs::remove_all(cache()); }

  Expected<rectification::DistortionMap> map(const CaseView& of, const std::optional<fs::path>& cache) {
    return plate_image_map(of, *given_->plate, rectification::Method::best, cache);
  }

  static inline TemporaryFolder* folder_ = nullptr;
  static inline Case* given_ = nullptr;
};

TEST_F(MapCache, MapOfAnEarlierMeasurementIsTheSame) {
  const auto fitted = map(view(), {});
  const auto first = map(view(), cache());
  ASSERT_TRUE(fitted && first);
  ASSERT_EQ(files_in(cache()).size(), 1u);
  EXPECT_EQ(fs::status(files_in(cache()).front()).permissions(),
            fs::perms::owner_read | fs::perms::owner_write);
  const auto again = map(view(), cache());
  ASSERT_TRUE(again);
  EXPECT_EQ(to_json(*again), to_json(*fitted));
  EXPECT_EQ(to_json(*again), to_json(*first));
}

TEST_F(MapCache, AnswerComesFromTheFile) {
  ASSERT_TRUE(map(view(), cache()));
  const fs::path file = files_in(cache()).front();
  Json kept = *read_json(file);
  kept["residual_rms_px"] = 0.125;
  ASSERT_TRUE(write_file(file, to_text(kept)));
  EXPECT_EQ(map(view(), cache())->residual_rms_px, 0.125);
}

TEST_F(MapCache, BrokenFileIsFittedAnewAndReplaced) {
  ASSERT_TRUE(map(view(), cache()));
  const fs::path file = files_in(cache()).front();
  ASSERT_TRUE(write_file(file, "{\"format\": 3"));
  EXPECT_TRUE(map(view(), cache()));
  EXPECT_TRUE(read_json(file));
}

TEST_F(MapCache, OtherPlateImageOrGeometryHasAnotherMap) {
  ASSERT_TRUE(map(view(), cache()));
  CaseView other = view();
  other.plate_image = given_->views.back().image;
  ASSERT_TRUE(map(other, cache()));
  EXPECT_EQ(files_in(cache()).size(), 2u);
  phantom::Plate plate = *given_->plate;
  plate.name += " again";
  ASSERT_TRUE(plate_image_map(view(), plate, rectification::Method::best, cache()));
  EXPECT_EQ(files_in(cache()).size(), 3u);
}

TEST_F(MapCache, OldestMapsLeaveAndFilesOfOthersStay) {
  const std::string digits(29, 'a');
  fs::create_directories(cache());
  for (int i = 0; i < 300; ++i) {
    ASSERT_TRUE(write_file(cache() / fmt::format("map_{}{:03}.json", digits, i), "{}"));
    ASSERT_TRUE(write_file(cache() / fmt::format("{}{:03}.json", digits, i), "{}"));
    ASSERT_TRUE(write_file(cache() / fmt::format("map_{}.json", i), "{}"));
  }
  ASSERT_TRUE(map(view(), cache()));
  EXPECT_EQ(files_in(cache()).size(), 256u + 600u);
}

TEST_F(MapCache, FolderThatCannotBeWrittenKeepsNothing) {
  const fs::path file = folder_->path() / "file";
  ASSERT_TRUE(write_file(file, "x"));
  EXPECT_TRUE(map(view(), file / "cache"));
}

}  // namespace
}  // namespace helicarm::pipeline

// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csignal>
#include <fstream>
#include <ostream>

#include <gtest/gtest.h>

#include "studies/journal.h"
#include "studies/small_studies.h"

namespace helicarm::study {

// GoogleTest finds it by this name. NOLINTNEXTLINE(readability-identifier-naming)
void PrintTo(const SmallStudy& study, std::ostream* out) { *out << study.name; }

namespace {

namespace fs = std::filesystem;

class EveryStudy : public ::testing::TestWithParam<SmallStudy> {
 protected:
  /// Named after the test: a death test's process begins anew and needs the same folder.
  void SetUp() override {
    std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::ranges::replace(test, '/', '_');
    folder_ = fs::path(::testing::TempDir()) / ("every_study_" + test);
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string bytes(const EngineOptions& engine) const { return GetParam().bytes(engine, Ranks(), folder_); }
  std::string bytes_by(unsigned threads) const {
    EngineOptions engine;
    engine.threads = threads;
    return bytes(engine);
  }

  fs::path folder_;
};

TEST_P(EveryStudy, BytesDoNotDependOnThreads) { EXPECT_EQ(bytes_by(1), bytes_by(3)); }

/// The content of a journal of any study.
JournalContent content_of(const fs::path& path) {
  std::string kind, identity;
  std::ifstream file(path);
  file >> kind >> std::ws;
  std::getline(file, identity);
  return Journal(path, identity).read().value();
}

TEST_P(EveryStudy, KilledRunKeepsFinishedBlocksAndResumesToTheSameBytes) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // OpenCV may have threads
  EngineOptions engine;
  engine.threads = 2;
  engine.journal = folder_ / "some.partial";
  engine.journal_after_s = 0;
  engine.progress = [done = std::size_t{0}](double) mutable {
    if (++done == GetParam().stop) std::raise(SIGKILL);
  };
  EXPECT_EXIT((void)bytes(engine), ::testing::KilledBySignal(SIGKILL), "");
  const JournalContent kept = content_of(engine.journal);
  EXPECT_EQ(kept.settled.size() * GetParam().blocks + kept.blocks.size(), GetParam().stop);

  engine.resume = true;
  engine.progress = [](double) {};
  EXPECT_EQ(bytes(engine), bytes_by(1));
  fs::remove(engine.journal);
  fs::remove_all(folder_ / kept_biplane_case);  // an output of its study
  EXPECT_TRUE(fs::is_empty(folder_));
}

INSTANTIATE_TEST_SUITE_P(All, EveryStudy, ::testing::ValuesIn(small_studies()),
                         [](const auto& given) { return given.param.name; });

}  // namespace
}  // namespace helicarm::study

// SPDX-License-Identifier: Apache-2.0
#include "studies/engine.h"

#include <atomic>
#include <fstream>
#include <numeric>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "studies/journal.h"

namespace helicarm::study {
namespace {

namespace fs = std::filesystem;

class Engine : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) /
              (std::string("engine_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  EngineOptions options() const {
    EngineOptions options;
    options.threads = 2;
    options.journal = folder_ / "some.partial";
    options.journal_after_s = 0;
    return options;
  }

  /// Settings of 10 blocks with 3 values that encode their block; counts the computed blocks and stops at the
  /// given one, as a kill would.
  std::vector<StudySetting> settings(int stop_at = -1) {
    std::vector<StudySetting> all;
    for (int s = 0; s < 3; ++s) {
      StudySetting setting{10, 3, 1, {}, {}};
      setting.work = [this, s, stop_at](std::size_t block, std::span<double> values) {
        if (worked_ == stop_at) throw std::runtime_error("stopped");
        ++worked_;
        for (std::size_t i = 0; i < 3; ++i) values[i] = 100 * s + 10 * double(block) + double(i);
      };
      setting.settle = [](std::span<const double> values) {
        return std::vector{values[0], values[29], std::accumulate(values.begin(), values.end(), 0.0)};
      };
      all.push_back(setting);
    }
    return all;
  }

  fs::path folder_;
  std::atomic<int> worked_{0};
  Ranks ranks_;
};

const std::vector<std::vector<double>> expected{{0, 92, 1380}, {100, 192, 4380}, {200, 292, 7380}};

TEST_F(Engine, ResultsDoNotDependOnThreads) {
  for (const unsigned threads : {1u, 2u, 5u}) {
    EngineOptions given = options();
    given.threads = threads;
    EXPECT_EQ(run_study(settings(), "a", given, ranks_).value(), expected);
  }
}

TEST_F(Engine, ResumedRunComputesOnlyMissingBlocks) {
  for (const int stop : {1, 9, 10, 14, 25}) {
    worked_ = 0;
    fs::remove(options().journal);
    EngineOptions given = options();
    given.threads = 1;
    EXPECT_THROW((void)run_study(settings(stop), "a", given, ranks_), std::runtime_error);
    given.resume = true;
    worked_ = 0;
    EXPECT_EQ(run_study(settings(), "a", given, ranks_).value(), expected) << stop;
    EXPECT_EQ(worked_, 30 - stop);
  }
}

TEST_F(Engine, IncompleteEndOfTheJournalIsRecomputed) {
  EngineOptions given = options();
  given.threads = 1;
  EXPECT_THROW((void)run_study(settings(14), "a", given, ranks_), std::runtime_error);
  fs::resize_file(given.journal, fs::file_size(given.journal) - 5);
  worked_ = 0;
  given.resume = true;
  EXPECT_EQ(run_study(settings(), "a", given, ranks_).value(), expected);
  EXPECT_EQ(worked_, 30 - 13);
}

TEST_F(Engine, AnotherStudysJournalIsRefused) {
  EXPECT_THROW((void)run_study(settings(5), "a", options(), ranks_), std::runtime_error);
  EngineOptions given = options();
  given.resume = true;
  const auto refused = run_study(settings(), "b", given, ranks_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_THAT(refused.error().message, ::testing::HasSubstr("some.partial"));
  given.resume = false;
  EXPECT_EQ(run_study(settings(), "b", given, ranks_).value(), expected);
}

TEST_F(Engine, ResumingWithoutAJournalStartsFromTheBeginning) {
  EngineOptions given = options();
  given.resume = true;
  EXPECT_EQ(run_study(settings(), "a", given, ranks_).value(), expected);
}

TEST_F(Engine, ShortRunsLeaveNoJournal) {
  EngineOptions given = options();
  given.journal_after_s = 3600;
  EXPECT_TRUE(run_study(settings(), "a", given, ranks_));
  EXPECT_FALSE(fs::exists(given.journal));
}

TEST_F(Engine, ProgressRisesToOne) {
  EngineOptions given = options();
  double last = 0;
  given.progress = [&](double share) {
    EXPECT_GE(share, last);
    last = share;
  };
  EXPECT_TRUE(run_study(settings(), "a", given, ranks_));
  EXPECT_NEAR(last, 1, 1e-12);
}

TEST_F(Engine, JournalIgnoresForeignBytes) {
  Journal journal(options().journal, "x");
  ASSERT_TRUE(journal.write({{{1, 2}, {}}, {{4, {7, 8, 9}}}}));
  ASSERT_TRUE(journal.append(2, std::vector{0.5}));
  std::ofstream(options().journal, std::ios::app) << "nonsense that is long enough for a head of a record";
  const auto content = Journal(options().journal, "x").read();
  ASSERT_TRUE(content);
  EXPECT_EQ(content->settled, (std::vector<std::vector<double>>{{1, 2}, {}}));
  ASSERT_EQ(content->blocks.size(), 2u);
  EXPECT_EQ(content->blocks[0].values, (std::vector<double>{7, 8, 9}));
  EXPECT_EQ(content->blocks[1].number, 2u);
}

}  // namespace
}  // namespace helicarm::study

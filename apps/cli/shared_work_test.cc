// SPDX-License-Identifier: Apache-2.0
#include "shared_work.h"

#include <atomic>
#include <thread>

#include <gmock/gmock.h>
#include <unistd.h>

#include "helicarm/core/temporary_folder.h"

namespace helicarm::cli {
namespace shared_work_test {

namespace fs = std::filesystem;

const std::vector<std::string> names{"a", "b", "c", "d", "e", "f", "g", "h"};

Json no_row(std::size_t) { return "given up"; }

/// Takes all that is left, and writes the index as the row.
std::vector<std::size_t> work_off(SharedWork& work) {
  std::vector<std::size_t> mine;
  while (const auto item = work.next(no_row)) {
    mine.push_back(item->index);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    work.done(*item, item->index);
  }
  return mine;
}

TEST(SharedWork, EachItemIsDoneByOneOfTwo) {
  const TemporaryFolder folder;
  std::vector<std::size_t> both[2];
  std::atomic<int> begun = 0, reports = 0;
  std::vector<Json> rows;
  {
    std::vector<std::jthread> workers;
    for (auto& mine : both)
      workers.emplace_back([&] {
        SharedWork work(folder.path(), {"job", 2}, names, [&] { ++begun; });
        mine = work_off(work);
        if (work.finish([&](const std::vector<Json>& all) { rows = all; })) ++reports;
      });
  }
  EXPECT_EQ(begun, 1);
  EXPECT_EQ(reports, 1);
  std::vector<std::size_t> all = both[0];
  all.insert(all.end(), both[1].begin(), both[1].end());
  EXPECT_THAT(all, testing::UnorderedElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_EQ(Json(rows), Json::parse("[0,1,2,3,4,5,6,7]"));
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(SharedWork, ItemOfAProcessThatEndedIsTakenOverOnceAndThenGivenUp) {
  const TemporaryFolder folder;
  SharedWork work(folder.path(), {"job"}, {"only"}, [] {});
  const auto first = work.next(no_row);
  ASSERT_TRUE(first);
  EXPECT_FALSE(first->taken_over);
  ::close(first->lock);  // as the kernel does for a process that ends
  const auto second = work.next(no_row);
  ASSERT_TRUE(second);
  EXPECT_TRUE(second->taken_over);
  ::close(second->lock);
  EXPECT_FALSE(work.next(no_row));
  EXPECT_TRUE(
      work.finish([](const std::vector<Json>& rows) { EXPECT_EQ(rows, std::vector<Json>{"given up"}); }));
}

TEST(SharedWork, SameWordGoesOnWhereItEnded) {
  const TemporaryFolder folder;
  {
    SharedWork work(folder.path(), {"night"}, names, [] {});
    work.done(*work.next(no_row), 0);
  }
  SharedWork work(folder.path(), {"night"}, names, [] { FAIL() << "began anew"; });
  EXPECT_THAT(work_off(work), testing::ElementsAre(1, 2, 3, 4, 5, 6, 7));
}

TEST(SharedWork, OtherCasesUnderTheSameWordAreRefused) {
  const TemporaryFolder folder;
  const SharedWork work(folder.path(), {"job"}, names, [] {});
  EXPECT_THROW(SharedWork(folder.path(), {"job"}, {"other"}, [] {}), BadInput);
}

TEST(SharedWork, OtherTermsUnderTheSameWordAreRefusedByName) {
  const TemporaryFolder folder;
  const SharedWork work(folder.path(), {"job"}, names, [] {}, {{"--method", "best"}, {"command", "run"}});
  EXPECT_NO_THROW(
      SharedWork(folder.path(), {"job"}, names, [] {}, {{"--method", "best"}, {"command", "run"}}));
  try {
    SharedWork(folder.path(), {"job"}, names, [] {}, {{"--method", "paper"}, {"command", "run"}});
    FAIL() << "took other options";
  } catch (const BadInput& refused) {
    EXPECT_EQ(refused.failure().reason, Reason::usage);
    EXPECT_THAT(refused.failure().message, testing::HasSubstr("--method was \"best\" and is \"paper\""));
    EXPECT_THAT(refused.failure().message, testing::Not(testing::HasSubstr("command")));
  }
}

TEST(SharedWork, WordWithoutALetterIsRefused) {
  const TemporaryFolder folder;
  EXPECT_THROW(SharedWork(folder.path(), {"../"}, names, [] {}), BadInput);
}

}  // namespace shared_work_test
}  // namespace helicarm::cli

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/session_log.h"

#include <array>
#include <csignal>
#include <fstream>
#include <thread>

#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <sys/resource.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::operation {
namespace session_log_test {

namespace fs = std::filesystem;

class Session : public testing::Test {
 protected:
  std::string bytes() const { return read_file(log_, 1 << 20).value(); }
  void overwrite(const std::string& content) const { std::ofstream(log_, std::ios::binary) << content; }
  void write_three() const {
    const auto session = SessionLog::open(log_).value();
    EXPECT_TRUE(session->append("pose", {{"of", "femur"}, {"x_mm", 1.25}}));
    EXPECT_TRUE(session->append("order", {{"text", "two\nlines"}}));
  }

  TemporaryFolder temporary_;
  /// A log whose first record is this text, with its checksum.
  void overwrite_with_record(const std::string& text) const {
    std::array<unsigned char, 32> hash{};
    EVP_Digest(text.data(), text.size(), hash.data(), nullptr, EVP_sha256(), nullptr);
    overwrite(fmt::format("{:02x} {}\n", fmt::join(hash, ""), text));
  }

  fs::path log_ = temporary_.path() / "session.log";
};

TEST_F(Session, AppendedRecordsReadBackEqual) {
  write_three();
  const SessionHistory history = read_session(log_).value();
  ASSERT_EQ(history.records.size(), 3u);
  EXPECT_EQ(history.records[0].kind, "session");
  EXPECT_EQ(history.records[1].content.at("x_mm"), 1.25);
  EXPECT_EQ(history.records[2].content.at("text"), "two\nlines");
  EXPECT_EQ(history.records[2].number, 2u);
  EXPECT_FALSE(history.torn);
}

TEST_F(Session, ContinuesAnExistingLog) {
  write_three();
  const auto session = SessionLog::open(log_).value();
  EXPECT_EQ(session->history().records.size(), 3u);
  EXPECT_TRUE(session->append("result", {}));
  EXPECT_EQ(read_session(log_).value().records.back().number, 3u);
}

TEST_F(Session, CutAtAnyByteKeepsEveryCompleteRecord) {
  write_three();
  const std::string whole = bytes();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    overwrite(whole.substr(0, size));
    const auto lines = std::size_t(std::count(whole.begin(), whole.begin() + std::ptrdiff_t(size), '\n'));
    const SessionHistory history = read_session(log_).value();
    EXPECT_EQ(history.records.size(), lines) << size;
    EXPECT_EQ(history.torn, size > 0 && whole[size - 1] != '\n') << size;
    if (size % 16 != 0) continue;  // syncing to disk is slow
    const auto session = SessionLog::open(log_).value();
    EXPECT_TRUE(session->append("more", {}));
    EXPECT_EQ(read_session(log_).value().records.size(), std::max<std::size_t>(lines, 1) + 1) << size;
  }
}

TEST_F(Session, EveryChangedByteIsDetected) {
  write_three();
  const std::string whole = bytes();
  for (std::size_t at = 0; at + 1 < whole.size(); ++at) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 1);
    overwrite(changed);
    const auto history = read_session(log_);
    EXPECT_FALSE(history && history->records.size() == 3 && !history->torn) << at;
  }
}

TEST_F(Session, RemovedLineIsDetected) {
  write_three();
  const std::string whole = bytes();
  const std::size_t first = whole.find('\n') + 1, second = whole.find('\n', first) + 1;
  overwrite(whole.substr(0, first) + whole.substr(second));
  const auto history = read_session(log_);
  ASSERT_FALSE(history);
  EXPECT_EQ(history.error().reason, Reason::bad_value);
  EXPECT_NE(history.error().message.find("line 2"), std::string::npos);
}

TEST_F(Session, AnotherFormatIsRefused) {
  overwrite("hello\n");
  EXPECT_EQ(read_session(log_).error().reason, Reason::bad_value);
  EXPECT_EQ(SessionLog::open(log_).error().reason, Reason::bad_value);
  EXPECT_EQ(bytes(), "hello\n");
}

TEST_F(Session, RecordNestedTooDeeplyIsRefused) {
  const std::string deep(200000, '[');
  overwrite_with_record(R"({"n":0,"time_s":1,"kind":"session","content":)" + deep +
                        std::string(deep.size(), ']') + "}");
  EXPECT_EQ(read_session(log_).error().reason, Reason::bad_json);
}

TEST_F(Session, ContentThatCannotBeReadBackIsNotAppended) {
  const auto session = SessionLog::open(log_).value();
  Json deep;
  for (int i = 0; i < 100; ++i) deep = Json::array({deep});
  EXPECT_EQ(session->append("plan", deep).error().reason, Reason::bad_json);
  EXPECT_TRUE(session->append("pose", {{"x_mm", 1}}));
  EXPECT_EQ(read_session(log_).value().records.size(), 2u);
}

TEST_F(Session, FormatOfAnotherTypeIsRefused) {
  for (const char* content : {R"({"format":1})", R"({"format":null})", R"({})", "[]", "7", "null"}) {
    overwrite_with_record(fmt::format(R"({{"n":0,"time_s":1,"kind":"session","content":{}}})", content));
    EXPECT_EQ(read_session(log_).error().reason, Reason::unsupported) << content;
    EXPECT_EQ(SessionLog::open(log_).error().reason, Reason::unsupported) << content;
  }
}

TEST_F(Session, RecordWithFieldsOfAnotherTypeIsRefused) {
  for (const char* record :
       {R"({"n":0.5,"time_s":1,"kind":"session","content":{"format":"helicarm-session/1"}})",
        R"({"n":0,"time_s":"1","kind":"session","content":{"format":"helicarm-session/1"}})",
        R"({"n":0,"time_s":1,"kind":["session"],"content":{"format":"helicarm-session/1"}})",
        R"({"n":0,"time_s":1,"kind":"session"})"}) {
    overwrite_with_record(record);
    EXPECT_EQ(read_session(log_).error().reason, Reason::bad_value) << record;
  }
}

TEST_F(Session, RecordThatIsNotAnObjectIsRefused) {
  for (const char* record : {"[]", "1", "null", "{", ""}) {
    overwrite_with_record(record);
    EXPECT_EQ(read_session(log_).error().reason, Reason::bad_json) << record;
  }
}

TEST_F(Session, IsLockedByOneProgram) {
  const auto first = SessionLog::open(log_).value();
  EXPECT_EQ(SessionLog::open(log_).error().reason, Reason::cannot_write);
}

TEST_F(Session, FullDiskIsReportedAndKeepsTheLogIntact) {
  const auto session = SessionLog::open(log_).value();
  const auto before = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  getrlimit(RLIMIT_FSIZE, &old);
  const rlimit tight{fs::file_size(log_) + 20, old.rlim_max};
  setrlimit(RLIMIT_FSIZE, &tight);
  const auto appended = session->append("pose", {{"x_mm", 1}});
  setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, before);
  ASSERT_FALSE(appended);
  EXPECT_EQ(appended.error().reason, Reason::cannot_write);
  EXPECT_TRUE(session->append("pose", {{"x_mm", 2}}));
  const SessionHistory history = read_session(log_).value();
  ASSERT_EQ(history.records.size(), 2u);
  EXPECT_EQ(history.records[1].content.at("x_mm"), 2);
}

/// An open log and its folder, which others may change.
class AttackedSession : public Session {
 protected:
  void SetUp() override {
    session_ = SessionLog::open(log_).value();
    ASSERT_TRUE(session_->append("order", {{"name", "femur"}}));
    ASSERT_TRUE(session_->intact());
  }
  void expect_lost() {
    EXPECT_EQ(session_->intact().error().reason, Reason::record_lost);
    const auto appended = session_->append("confirmed", {{"order", "femur"}});
    ASSERT_FALSE(appended);
    EXPECT_EQ(appended.error().reason, Reason::record_lost) << appended.error().message;
    EXPECT_NE(appended.error().message.find(log_.string()), std::string::npos);
  }

  const fs::path aside_ = temporary_.path() / "aside";
  std::unique_ptr<SessionLog> session_;
};

TEST_F(AttackedSession, RemovedLogIsLost) {
  fs::remove(log_);
  expect_lost();
  EXPECT_FALSE(fs::exists(log_));
}

TEST_F(AttackedSession, LogReplacedByItsCopyIsLost) {
  fs::copy_file(log_, aside_);
  fs::rename(aside_, log_);
  expect_lost();
}

TEST_F(AttackedSession, LogWhoseFolderWasMovedIsLostUntilItIsBack) {
  const fs::path inner = temporary_.path() / "session", log = inner / "session.log";
  session_ = SessionLog::open(log).value();
  fs::rename(inner, aside_);
  EXPECT_EQ(session_->append("order", {}).error().reason, Reason::record_lost);
  fs::rename(aside_, inner);
  EXPECT_TRUE(session_->append("order", {}));
  EXPECT_EQ(read_session(log).value().records.size(), 2u);
}

TEST_F(AttackedSession, LogThatWasCutIsLost) {
  fs::resize_file(log_, fs::file_size(log_) - 5);
  expect_lost();
}

TEST_F(AttackedSession, LogThatOthersAppendToIsLost) {
  std::ofstream(log_, std::ios::app) << "x\n";
  expect_lost();
}

TEST_F(AttackedSession, LogOfTheSameSizeWithAnotherContentIsLost) {
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // the file system's clock ticks
  std::string content = bytes();
  content[content.size() - 8] ^= 1;
  std::fstream(log_, std::ios::in | std::ios::out | std::ios::binary) << content;
  expect_lost();
}

TEST_F(AttackedSession, TouchedLogWithItsContentIsNotLost) {
  fs::last_write_time(log_, fs::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_TRUE(session_->intact());
  EXPECT_TRUE(session_->append("confirmed", {}));
}

TEST_F(Session, FolderThatCannotBeCreatedIsReported) {
  EXPECT_EQ(SessionLog::open("/dev/null/session.log").error().reason, Reason::cannot_write);
}

}  // namespace session_log_test
}  // namespace helicarm::operation

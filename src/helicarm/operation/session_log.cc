// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/session_log.h"

#include <array>
#include <cerrno>
#include <chrono>
#include <stdexcept>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/system_message.h"

namespace helicarm::operation {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view format_name = "helicarm-session/1";
constexpr std::size_t chain_digits = 64;  // SHA-256
constexpr std::uintmax_t most_log_bytes = std::uintmax_t{1} << 30;
constexpr int most_records = 100'000'000;

std::string link(std::string_view chain, std::string_view text) {
  const std::string both = std::string(chain) + std::string(text);
  std::array<unsigned char, chain_digits / 2> hash{};
  if (EVP_Digest(both.data(), both.size(), hash.data(), nullptr, EVP_sha256(), nullptr) != 1)
    throw std::runtime_error("no SHA-256 implementation available");
  return fmt::format("{:02x}", fmt::join(hash, ""));
}

double unix_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

SessionRecord record_of(std::string_view text, const std::string& where) {
  const Json json = value_or_throw(parse_json(text, where));
  JsonReader reader(json, where);
  SessionRecord record{static_cast<std::uint64_t>(reader.integer("n", 0, most_records)),
                       reader.number("time_s", {0, 1e12}), reader.text("kind"), reader.raw("content")};
  if (!json.contains("content")) reader.refuse(Reason::bad_value, "content", "is missing");
  reader.finish();
  return record;
}

bool begins_log(const SessionRecord& record) {
  return record.kind == "session" && record.content.is_object() && record.content.contains("format") &&
         record.content["format"] == format_name;
}

struct Progress {
  SessionHistory history;
  std::string chain;
};

Progress read(const fs::path& log, std::string_view bytes) {
  Progress progress;
  std::size_t& at = progress.history.whole_bytes;
  while (at < bytes.size()) {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string_view::npos) {
      progress.history.torn = true;
      break;
    }
    const std::string_view line = bytes.substr(at, end - at);
    const std::uint64_t number = progress.history.records.size();
    const std::string where = fmt::format("{}: line {}", log.string(), number + 1);
    const auto refuse = [&](Reason reason, std::string_view problem) {
      throw BadInput(reason, fmt::format("{}: {}", where, problem));
    };
    if (line.size() < chain_digits + 1 || line[chain_digits] != ' ')
      refuse(Reason::bad_value, "is not a record");
    const std::string_view text = line.substr(chain_digits + 1);
    progress.chain = link(progress.chain, text);
    if (line.substr(0, chain_digits) != progress.chain)
      refuse(Reason::bad_value, "invalid checksum: this or an earlier line was changed");
    progress.history.records.push_back(record_of(text, where));
    const SessionRecord& record = progress.history.records.back();
    if (record.number != number) refuse(Reason::bad_value, "wrong record number");
    if (number == 0 && !begins_log(record))
      refuse(Reason::unsupported, fmt::format("is not the first record of a {} log", format_name));
    at = end + 1;
  }
  return progress;
}

std::int64_t changed_ns(const struct stat& file) {
  return file.st_mtim.tv_sec * std::int64_t{1'000'000'000} + file.st_mtim.tv_nsec;
}

/// So that the name of a new file outlives a loss of power.
void sync_folder(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  ::fsync(opened);
  ::close(opened);
}

}  // namespace

Expected<SessionHistory> read_session(const fs::path& log) {
  return guarded([&] { return read(log, value_or_throw(read_file(log, most_log_bytes))).history; });
}

Expected<std::unique_ptr<SessionLog>> SessionLog::open(const fs::path& log) {
  return guarded([&] {
    std::error_code ec;
    if (log.has_parent_path()) fs::create_directories(log.parent_path(), ec);
    const int file = ::open(log.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (file < 0)
      throw BadInput(Reason::cannot_write,
                     fmt::format("{}: {}", log.string(), system_message(ec ? ec.value() : errno)));
    std::unique_ptr<SessionLog> session(new SessionLog(log, file));
    if (::flock(file, LOCK_EX | LOCK_NB) != 0)
      throw BadInput(Reason::cannot_write, fmt::format("{}: is open in another program", log.string()));
    Progress progress = read(log, value_or_throw(read_file(log, most_log_bytes)));
    session->history_ = std::move(progress.history);
    session->chain_ = std::move(progress.chain);
    session->next_ = session->history_.records.size();
    session->size_ = session->history_.whole_bytes;
    if (session->history_.torn && ::ftruncate(file, static_cast<off_t>(session->size_)) != 0)
      throw BadInput(Reason::cannot_write, fmt::format("{}: {}", log.string(), system_message(errno)));
    if (struct stat opened; ::fstat(file, &opened) == 0) session->written_ns_ = changed_ns(opened);
    if (session->next_ == 0) {
      sync_folder(log);
      value_or_throw(session->append("session", {{"format", format_name}, {"version", HELICARM_VERSION}}));
    }
    return session;
  });
}

SessionLog::~SessionLog() { ::close(file_); }

Expected<void> SessionLog::intact() {
  const std::lock_guard lock(mutex_);
  return check_file();
}

Expected<void> SessionLog::check_file() {
  const auto lost = [&](std::string_view loss) {
    return fail(Reason::record_lost,
                fmt::format("{}: the record of this operation {}; nothing may move without it: begin a new "
                            "operation in another folder",
                            log_.string(), loss));
  };
  struct stat ours, named;
  if (::fstat(file_, &ours) != 0) return lost("cannot be read");
  if (::stat(log_.c_str(), &named) != 0) return lost("was removed");
  if (ours.st_dev != named.st_dev || ours.st_ino != named.st_ino) return lost("was replaced by another file");
  if (static_cast<std::size_t>(ours.st_size) != size_)
    return lost(fmt::format("was changed by another program: it holds {} bytes, {} were written",
                            ours.st_size, size_));
  if (changed_ns(ours) == written_ns_) return {};
  // Network file systems also adjust the time; the content decides.
  const auto now = guarded([&] { return read(log_, value_or_throw(read_file(log_, most_log_bytes))).chain; });
  if (!now || *now != chain_) return lost("was changed by another program");
  written_ns_ = changed_ns(ours);
  return {};
}

Expected<void> SessionLog::append(const std::string& kind, Json content) {
  const std::lock_guard lock(mutex_);
  if (auto whole = check_file(); !whole) return whole;
  const std::string text =
      Json{{"n", next_}, {"time_s", unix_seconds()}, {"kind", kind}, {"content", std::move(content)}}.dump(
          -1, ' ', false, Json::error_handler_t::replace);
  if (auto read_back = parse_json(text, log_.string()); !read_back)
    return tl::unexpected<Failure>(read_back.error());
  std::string chain = link(chain_, text);
  const std::string line = chain + ' ' + text + '\n';
  const ssize_t written = ::write(file_, line.data(), line.size());
  if (written != static_cast<ssize_t>(line.size()) || ::fdatasync(file_) != 0) {
    const int error = written < 0 ? errno : ENOSPC;
    [[maybe_unused]] const int cut = ::ftruncate(file_, static_cast<off_t>(size_));
    if (struct stat now; ::fstat(file_, &now) == 0) written_ns_ = changed_ns(now);
    return fail(Reason::cannot_write, fmt::format("{}: {}", log_.string(), system_message(error)));
  }
  chain_ = std::move(chain);
  size_ += line.size();
  ++next_;
  if (struct stat now; ::fstat(file_, &now) == 0) written_ns_ = changed_ns(now);
  return check_file();  // it may have been removed meanwhile
}

}  // namespace helicarm::operation

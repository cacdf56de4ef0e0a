// SPDX-License-Identifier: Apache-2.0
#include "studies/journal.h"

#include <bit>
#include <cerrno>
#include <cstring>
#include <optional>

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/system_message.h"

namespace helicarm::study {
namespace {

constexpr std::uintmax_t most_journal_bytes = std::uintmax_t{1} << 36;
constexpr std::uint64_t settled_number = ~std::uint64_t{0};  // not a block number

struct RecordHead {
  std::uint64_t number;  ///< of the block
  std::uint64_t count;   ///< of the values
  std::uint64_t sum;
};

/// FNV hash over 64-bit words (Fowler, Noll, Vo).
std::uint64_t check_sum(std::uint64_t number, std::span<const double> values) {
  std::uint64_t hash = 0xCBF29CE484222325;
  const auto add = [&](std::uint64_t word) { hash = (hash ^ word) * 0x100000001B3; };
  add(number);
  add(values.size());
  for (const double value : values) add(std::bit_cast<std::uint64_t>(value));
  return hash;
}

std::string record(std::uint64_t number, std::span<const double> values) {
  const RecordHead head{number, values.size(), check_sum(number, values)};
  std::string bytes(sizeof head + values.size_bytes(), '\0');
  std::memcpy(bytes.data(), &head, sizeof head);
  if (!values.empty()) std::memcpy(bytes.data() + sizeof head, values.data(), values.size_bytes());
  return bytes;
}

/// Removes the first record; empty if it is incomplete.
std::optional<JournalContent::Block> take_record(std::string_view& bytes) {
  RecordHead head{};
  if (bytes.size() < sizeof head) return std::nullopt;
  std::memcpy(&head, bytes.data(), sizeof head);
  const std::string_view rest = bytes.substr(sizeof head);
  if (head.count > rest.size() / sizeof(double)) return std::nullopt;
  std::vector<double> values(head.count);
  if (!values.empty()) std::memcpy(values.data(), rest.data(), head.count * sizeof(double));
  if (head.sum != check_sum(head.number, values)) return std::nullopt;
  bytes = rest.substr(head.count * sizeof(double));
  return JournalContent::Block{head.number, std::move(values)};
}

}  // namespace

Journal::Journal(std::filesystem::path path, std::string identity)
    : path_(std::move(path)), identity_("helicarm-study-journal/1 " + std::move(identity) + "\n") {}

Journal::~Journal() {
  if (file_ >= 0) ::close(file_);
}

Expected<JournalContent> Journal::read() const {
  JournalContent content;
  std::error_code error;
  if (!std::filesystem::exists(path_, error)) return content;
  const auto bytes = read_file(path_, most_journal_bytes);
  if (!bytes) return tl::unexpected<Failure>(bytes.error());
  if (!bytes->starts_with(identity_))
    return fail(Reason::bad_value,
                fmt::format("{}: belongs to a study with other options or of another version; remove it, or "
                            "run without --resume",
                            path_.string()));
  std::string_view rest = std::string_view(*bytes).substr(identity_.size());
  while (auto next = take_record(rest)) {
    if (next->number == settled_number)
      content.settled.push_back(std::move(next->values));
    else
      content.blocks.push_back(std::move(*next));
  }
  return content;
}

Expected<void> Journal::write(const JournalContent& content) {
  if (file_ >= 0) ::close(file_);
  std::string bytes = identity_;
  for (const auto& values : content.settled) bytes += record(settled_number, values);
  for (const auto& block : content.blocks) bytes += record(block.number, block.values);
  if (auto done = write_file(path_, bytes); !done) return done;
  file_ = ::open(path_.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (file_ < 0)
    return fail(Reason::cannot_write, fmt::format("{}: {}", path_.string(), system_message(errno)));
  return {};
}

Expected<void> Journal::append(std::size_t block, std::span<const double> values) {
  const std::string bytes = record(block, values);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = ::write(file_, bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0)
      return fail(Reason::cannot_write, fmt::format("{}: {}", path_.string(), system_message(errno)));
    done += std::size_t(written);
  }
  return {};
}

}  // namespace helicarm::study

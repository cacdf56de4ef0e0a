// SPDX-License-Identifier: Apache-2.0
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "helicarm/core/files.h"
#include "helicarm/operation/session_log.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

/// The log whose records are the lines of `texts`, each with its checksum.
std::string with_chain(std::string_view texts) {
  std::string log, chain;
  while (!texts.empty()) {
    const std::size_t end = std::min(texts.find('\n'), texts.size());
    const std::string both = chain + std::string(texts.substr(0, end));
    std::array<unsigned char, 32> hash{};
    EVP_Digest(both.data(), both.size(), hash.data(), nullptr, EVP_sha256(), nullptr);
    chain = fmt::format("{:02x}", fmt::join(hash, ""));
    log += fmt::format("{} {}", chain, texts.substr(0, end));
    if (end < texts.size()) log += '\n';
    texts.remove_prefix(std::min(end + 1, texts.size()));
  }
  return log;
}

}  // namespace

void run(std::string_view bytes) {
  const bool as_it_is = Choices(bytes).byte() % 8 == 7;
  const auto path = put_file("session.log", as_it_is ? std::string(bytes) : with_chain(bytes));
  const auto history = operation::read_session(path);
  auto session = operation::SessionLog::open(path);
  check(history.has_value() == session.has_value(), "a readable log can be continued");
  if (!history) return;
  for (std::size_t i = 0; i < history->records.size(); ++i)
    check(history->records[i].number == i && std::isfinite(history->records[i].time_s),
          "records are in order");
  check((*session)->append("more", {{"x_mm", 1}}).has_value(), "a record can be added");
  const auto again = operation::read_session(path);
  check(again.has_value() && !again->torn, "the log is complete again");
  check(again->records.size() == std::max<std::size_t>(history->records.size(), 1) + 1, "no record is lost");
}

std::vector<std::string> seeds() {
  const auto path = folder() / "seed.log";
  {
    const auto session = operation::SessionLog::open(path).value();
    for (int i = 0; i < 3; ++i)
      check(session->append("pose", {{"of", "femur"}, {"x_mm", 1.25 * i}}).has_value(), "a seed is written");
  }
  const std::string log = read_file(path, 1 << 20).value();
  std::string texts;
  for (std::size_t at = 0; at < log.size();) {
    const std::size_t end = log.find('\n', at);
    texts += log.substr(at + 65, end + 1 - at - 65);
    at = end + 1;
  }
  return {'\7' + log, '\0' + texts, '\0' + texts.substr(0, texts.find('\n') + 1)};
}

}  // namespace helicarm::fuzz

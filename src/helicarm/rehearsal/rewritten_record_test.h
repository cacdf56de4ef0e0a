// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <fmt/ranges.h>
#include <openssl/evp.h>

#include "helicarm/operation/session_log.h"

namespace helicarm::rehearsal {

inline std::string sha256(const std::string& text) {
  std::array<unsigned char, 32> hash{};
  EVP_Digest(text.data(), text.size(), hash.data(), nullptr, EVP_sha256(), nullptr);
  return fmt::format("{:02x}", fmt::join(hash, ""));
}

/// Writes the records with a valid chain and consecutive numbers.
inline void rewrite_record(const std::filesystem::path& session,
                           const std::vector<operation::SessionRecord>& records) {
  std::string chain, log;
  std::uint64_t number = 0;
  for (const operation::SessionRecord& record : records) {
    const std::string text =
        Json{{"n", number++}, {"time_s", record.time_s}, {"kind", record.kind}, {"content", record.content}}
            .dump();
    chain = sha256(chain + text);
    log += chain + ' ' + text + '\n';
  }
  std::ofstream(session / "session.log", std::ios::binary) << log;
}

}  // namespace helicarm::rehearsal

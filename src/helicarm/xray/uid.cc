// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/uid.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/random.h>

namespace helicarm::xray {
namespace {

using Words = std::array<std::uint32_t, 4>;  // most significant first

std::string uid_of(Words words) {
  words[1] = (words[1] & 0xFFFF0FFFu) | 0x4000u;      // version 4: random
  words[2] = (words[2] & 0x3FFFFFFFu) | 0x80000000u;  // RFC 4122 variant
  std::string digits;
  while (std::ranges::any_of(words, [](std::uint32_t w) { return w != 0; })) {
    std::uint64_t rest = 0;
    for (std::uint32_t& word : words) {
      rest = rest << 32 | word;
      word = static_cast<std::uint32_t>(rest / 10);
      rest %= 10;
    }
    digits += static_cast<char>('0' + rest);
  }
  std::ranges::reverse(digits);
  return "2.25." + digits;
}

}  // namespace

std::string uid_of(const std::string& key) {
  Words words;
  for (std::size_t i = 0; i < words.size(); ++i)
    words[i] = static_cast<std::uint32_t>(std::stoul(key.substr(8 * i, 8), nullptr, 16));
  return uid_of(words);
}

std::string text_key(std::string_view text) {
  if (text.empty()) return {};
  std::array<unsigned char, EVP_MAX_MD_SIZE> hash{};
  unsigned size = 0;
  if (EVP_Digest(text.data(), text.size(), hash.data(), &size, EVP_sha256(), nullptr) != 1)
    throw std::runtime_error("SHA-256 is not available");
  std::string key;
  for (std::size_t i = 0; i < 16; ++i) key += fmt::format("{:02x}", hash[i]);
  return key;
}

std::string make_uid() {
  Words words;
  if (::getrandom(words.data(), sizeof words, 0) != sizeof words)
    throw std::system_error(errno, std::generic_category(), "getrandom");
  return uid_of(words);
}

std::string make_uid(RandomStream& random) {
  Words words;
  for (std::uint32_t& word : words) word = random.bits();
  return uid_of(words);
}

}  // namespace helicarm::xray

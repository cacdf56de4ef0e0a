// SPDX-License-Identifier: Apache-2.0
// Entry points of libFuzzer for all targets, and `TARGET --seeds FOLDER DICTIONARY`.
#include "target.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/temporary_folder.h"

namespace helicarm::fuzz {
namespace {

namespace fs = std::filesystem;

bool in_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' || c == ' ';
}

/// Words of the seeds as a libFuzzer dictionary, for faster discovery of keys and keywords.
std::string dictionary(const std::vector<std::string>& texts) {
  constexpr std::size_t shortest = 3, longest = 40;
  std::set<std::string> words;
  for (const std::string& text : texts)
    for (auto begin = text.begin(); begin != text.end();) {
      begin = std::find_if(begin, text.end(), in_word);
      const auto end = std::find_if_not(begin, text.end(), in_word);
      if (const auto size = std::size_t(end - begin); size >= shortest && size <= longest)
        words.emplace(begin, end);
      begin = end;
    }
  std::string lines;
  for (const std::string& word : words) lines += fmt::format("\"{}\"\n", word);
  return lines;
}

void write_seeds(const fs::path& into, const fs::path& words) {
  fs::create_directories(into);
  const auto all = seeds();
  for (std::size_t i = 0; i < all.size(); ++i)
    std::ofstream(into / fmt::format("seed_{:03}", i), std::ios::binary) << all[i];
  std::ofstream(words) << dictionary(all);
}

}  // namespace

void check(bool holds, const char* condition) {
  if (holds) return;
  std::fprintf(stderr, "broken promise: %s\n", condition);
  std::abort();
}

const fs::path& folder() {
  static const TemporaryFolder temporary;
  return temporary.path();
}

fs::path put_file(const std::string& name, std::string_view bytes) {
  fs::path path = folder() / name;
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

unsigned Choices::byte() {
  const std::string_view one = take(1);
  return one.empty() ? 0 : static_cast<unsigned char>(one[0]);
}

std::string_view Choices::take(std::size_t size) {
  const std::string_view taken = bytes_.substr(0, size);
  bytes_.remove_prefix(taken.size());
  return taken;
}

}  // namespace helicarm::fuzz

extern "C" int LLVMFuzzerInitialize(int* count, char*** arguments) {
  if (*count == 4 && std::string_view((*arguments)[1]) == "--seeds") {
    helicarm::fuzz::write_seeds((*arguments)[2], (*arguments)[3]);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  helicarm::fuzz::run({reinterpret_cast<const char*>(bytes), size});
  return 0;
}

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/tar_gz.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "helicarm/volume/gzip.h"

namespace helicarm::pipeline {
namespace {

constexpr std::size_t tar_block = 512;

/// IEEE Std 1003.1, pax, ustar Interchange Format: a regular file, mode 0644, owner and time 0.
std::string ustar_header(const ArchivedFile& file) {
  if (file.name.empty() || file.name.size() > 100) throw std::invalid_argument("tar: name of " + file.name);
  std::string header(tar_block, '\0');
  const auto put = [&](std::size_t at, const std::string& text) {
    std::ranges::copy(text, header.begin() + std::ptrdiff_t(at));
  };
  put(0, file.name);
  put(100, "0000644");
  put(108, "0000000");
  put(116, "0000000");
  put(124, fmt::format("{:011o}", file.bytes.size()));
  put(136, "00000000000");
  put(148, "        ");
  put(156, "0");
  put(257, std::string("ustar\0"
                       "00",
                       8));
  unsigned sum = 0;
  for (const char c : header) sum += static_cast<unsigned char>(c);
  put(148, fmt::format("{:06o}", sum) + std::string("\0 ", 2));
  return header;
}

}  // namespace

std::string tar_gz(std::span<const ArchivedFile> files) {
  std::string tar;
  for (const ArchivedFile& file : files) {
    tar += ustar_header(file) + file.bytes;
    tar.resize((tar.size() + tar_block - 1) / tar_block * tar_block, '\0');
  }
  tar.append(2 * tar_block, '\0');
  return volume::gzip(tar);
}

}  // namespace helicarm::pipeline

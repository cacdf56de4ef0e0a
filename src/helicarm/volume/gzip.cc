// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/gzip.h"

#include <algorithm>
#include <array>
#include <new>

#define ZLIB_CONST
#include <zlib.h>

namespace helicarm::volume {

std::string gzip(std::string_view bytes, int level) {
  z_stream stream{};
  constexpr int gzip_format = 15 + 16;
  if (deflateInit2(&stream, level, Z_DEFLATED, gzip_format, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  std::string packed;
  std::array<char, 1 << 16> chunk;
  std::size_t at = 0;
  int state = Z_OK;
  while (state != Z_STREAM_END) {
    const std::size_t count = std::min<std::size_t>(bytes.size() - at, 1u << 30);  // zlib counts in 32 bits
    stream.next_in = reinterpret_cast<const Bytef*>(bytes.data() + at);
    stream.avail_in = static_cast<uInt>(count);
    at += count;
    do {
      stream.next_out = reinterpret_cast<Bytef*>(chunk.data());
      stream.avail_out = chunk.size();
      state = deflate(&stream, at == bytes.size() ? Z_FINISH : Z_NO_FLUSH);
      packed.append(chunk.data(), chunk.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  }
  deflateEnd(&stream);
  return packed;
}

}  // namespace helicarm::volume

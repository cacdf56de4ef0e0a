// SPDX-License-Identifier: Apache-2.0
// Code of this project against the library's that could replace it: the reason to keep it.
#include <cstring>

#include <Random123/philox.h>
#include <benchmark/benchmark.h>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcrledec.h>

#include "helicarm/core/random.h"
#include "helicarm/xray/rle.h"
#include "studies/simd_random.h"

namespace helicarm {
namespace {

constexpr std::size_t side = 1024;
constexpr std::uint32_t blocks = 1024;

/// Words of four streams by Random123, one stream after the other.
void words_of_random123(benchmark::State& state) {
  for (auto _ : state)
    for (std::uint32_t block = 0; block < blocks; ++block)
      for (std::uint32_t trial = 0; trial < 4; ++trial)
        benchmark::DoNotOptimize(r123::Philox4x32()({{block, 5, trial, 0}}, {{7, 0}}));
  state.SetItemsProcessed(state.iterations() * blocks * 16);
}
BENCHMARK(words_of_random123);

void words_in_simd(benchmark::State& state) {
  const study::SimdRandom random(7, 5, 0);
  for (auto _ : state)
    for (std::uint32_t block = 0; block < blocks; ++block) benchmark::DoNotOptimize(random.words(block));
  state.SetItemsProcessed(state.iterations() * blocks * 16);
}
BENCHMARK(words_in_simd);

/// A frame of 16 bits whose rows alternate runs and noise, as one RLE frame of two segments.
std::string packed_segment() {
  RandomStream random(1, 1);
  std::string packed;
  for (std::size_t at = 0; at < side * side; at += 64) {
    packed += static_cast<char>(1 - 32);
    packed += static_cast<char>(random.bits());
    packed += static_cast<char>(31);
    for (int i = 0; i < 32; ++i) packed += static_cast<char>(random.bits());
  }
  return packed;
}

std::string frame_of(const std::string& segment) {
  std::string frame(64, '\0');
  const std::uint32_t header[] = {2, 64, static_cast<std::uint32_t>(64 + segment.size())};
  std::memcpy(frame.data(), header, sizeof header);
  return frame + segment + segment;
}

void rle_of_helicarm(benchmark::State& state) {
  const std::string frame = frame_of(packed_segment());
  for (auto _ : state) {
    auto words = xray::decode_rle(frame, side * side, 2, "frame");
    if (!words) state.SkipWithError("damaged");
    benchmark::DoNotOptimize(words);
  }
}
BENCHMARK(rle_of_helicarm)->Unit(benchmark::kMicrosecond);

/// DCMTK's decoder unpacks one segment; the header, the segments and their interleaving stay with the caller.
void rle_of_dcmtk(benchmark::State& state) {
  std::string segment = packed_segment();
  for (auto _ : state) {
    std::string words(2 * side * side, '\0');
    for (std::size_t byte = 0; byte < 2; ++byte) {
      DcmRLEDecoder decoder(side * side);
      if (decoder.decompress(segment.data(), segment.size()).bad()) state.SkipWithError("damaged");
      const auto* bytes = static_cast<const char*>(decoder.getOutputBuffer());
      for (std::size_t i = 0; i < side * side; ++i) words[2 * i + 1 - byte] = bytes[i];
    }
    benchmark::DoNotOptimize(words);
  }
}
BENCHMARK(rle_of_dcmtk)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace helicarm

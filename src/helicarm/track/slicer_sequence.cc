// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/slicer_sequence.h"

#include <algorithm>

#include <fmt/format.h>

namespace helicarm::track {
namespace {

/// Slicer's reader splits lines at "=" and fields at "_" before the name, and takes names that hold "Status"
/// for none.
std::string transform_name(std::string name) {
  for (char& c : name)
    if (c == '=' || c == '\n' || c == '\r') c = '-';
  for (const std::string_view word : {"Status", "Transform"})
    for (std::size_t at = 0; (at = name.find(word)) != name.npos;) name[at] = char(name[at] + ('a' - 'A'));
  return name + "ToWorld";
}

}  // namespace

std::string slicer_sequence(const std::vector<std::string>& names, const std::vector<int>& frames,
                            const std::vector<BodySequence>& bodies, std::optional<double> rate_hz) {
  constexpr double highest_rate_hz = 500;
  const bool has_times = rate_hz && *rate_hz <= highest_rate_hz;
  const Eigen::DiagonalMatrix<double, 4> ras_from_lps(-1, -1, 1, 1);
  std::string text = fmt::format(
      "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\nBinaryData = True\nBinaryDataByteOrderMSB "
      "= False\n"
      "CompressedData = False\nDimSize = 0 0 {}\nElementSpacing = 1 1 1\nOffset = 0 0 0\n"
      "TransformMatrix = 1 0 0 0 1 0 0 0 1\nElementType = MET_UCHAR\nKinds = domain domain list\n",
      frames.size());
  for (std::size_t f = 0; f < frames.size(); ++f) {
    const std::string frame = fmt::format("Seq_Frame{:04d}_", f);
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const std::string field = frame + transform_name(names[b]) + "Transform";
      const auto& pose = bodies[b].smoothed[f].pose;
      if (pose) {
        const Eigen::Matrix4d ras = ras_from_lps * pose->pose.matrix() * ras_from_lps;
        text += field + " =";
        for (int i = 0; i < 16; ++i) text += fmt::format(" {:.12g}", ras(i / 4, i % 4) + 0.0);
        text += "\n";
      }
      text += fmt::format("{}Status = {}\n", field, pose ? "OK" : "INVALID");
    }
    text += frame + "Timestamp = ";
    text += has_times ? fmt::format("{:.6f}\n", (frames[f] - frames.front()) / *rate_hz)
                      : fmt::format("{}\n", frames[f]);
  }
  return text + "ElementDataFile = LOCAL\n";
}

}  // namespace helicarm::track

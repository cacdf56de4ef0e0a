// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/sequence_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"

namespace helicarm::tracker {
namespace {

constexpr std::uintmax_t max_sequence_bytes = std::uintmax_t{512} << 20;  // an hour of five tools at 60 Hz

[[noreturn]] void refuse_line(std::size_t line, std::string_view problem) {
  throw BadInput(Reason::bad_value, fmt::format("line {}: {}", line, problem));
}

/// Removes and returns the next word as a number. "nan" is accepted here: PoseGate rejects it.
double take_number(std::string_view& text, std::size_t line) {
  text = trimmed(text);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || (end != text.data() + text.size() && *end != ' '))
    refuse_line(line, "a number is missing");
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return value;
}

/// Time differences are used as waiting times, which have 64 bits of nanoseconds.
double take_time(std::string_view& text, std::size_t line) {
  constexpr double latest_s = 4e9;  // UTC until 2096
  const double time_s = take_number(text, line);
  if (!(std::abs(time_s) <= latest_s)) refuse_line(line, fmt::format("a time beyond {} s", latest_s));
  return time_s;
}

Eigen::Matrix4d matrix_of(std::string_view text, std::size_t line) {
  Eigen::Matrix4d matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix(row, column) = take_number(text, line);
  if (!trimmed(text).empty()) refuse_line(line, "more than 16 numbers");
  return matrix;
}

struct FrameField {
  int frame;
  std::string_view name;
};

/// "Seq_Frame0012_Timestamp" is frame 12's Timestamp.
std::optional<FrameField> frame_field(std::string_view key) {
  constexpr std::string_view prefix = "Seq_Frame";
  if (!key.starts_with(prefix)) return std::nullopt;
  key.remove_prefix(prefix.size());
  int frame = 0;
  const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), frame);
  if (error != std::errc() || frame < 0 || end == key.data() + key.size() || *end != '_') return std::nullopt;
  key.remove_prefix(static_cast<std::size_t>(end - key.data()) + 1);
  return FrameField{frame, key};
}

struct ReadFrame {
  std::optional<double> time_s;
  std::map<std::string, Eigen::Matrix4d> matrices;
  std::map<std::string, bool> visible;
};

void take_field(ReadFrame& frame, std::string_view name, std::string_view value, std::size_t line) {
  constexpr std::string_view pose = "Transform", status = "TransformStatus";
  const auto without = [&](std::string_view ending) {
    return std::string(name.substr(0, name.size() - ending.size()));
  };
  if (name == "Timestamp")
    frame.time_s = take_time(value, line);
  else if (name.ends_with(pose))
    frame.matrices[without(pose)] = matrix_of(value, line);
  else if (name.ends_with(status))
    frame.visible[without(status)] = value == "OK";
}

std::vector<SequenceFrame> parse_sequence(std::string_view text) {
  std::map<int, ReadFrame> read;
  for (std::size_t line = 1;; ++line) {
    const auto end = text.find('\n');
    const std::string_view whole = text.substr(0, end);
    const auto equals = whole.find('=');
    const std::string_view key = trimmed(whole.substr(0, equals));
    if (equals != whole.npos && key == "ElementDataFile") break;
    if (end == text.npos) throw BadInput(Reason::truncated, "the header ends without ElementDataFile");
    if (equals == whole.npos) refuse_line(line, "no \"key = value\"");
    if (const auto field = frame_field(key))
      take_field(read[field->frame], field->name, trimmed(whole.substr(equals + 1)), line);
    text.remove_prefix(end + 1);
  }
  std::vector<SequenceFrame> frames;
  for (const auto& [number, frame] : read) {
    if (!frame.time_s) throw BadInput(Reason::bad_value, fmt::format("frame {} has no Timestamp", number));
    SequenceFrame& added = frames.emplace_back();
    added.time_s = *frame.time_s;
    for (const auto& [name, matrix] : frame.matrices) {
      const auto status = frame.visible.find(name);
      added.poses[name] = {matrix, status == frame.visible.end() || status->second};
    }
  }
  return frames;
}

/// A matrix of RAS as a motion of LPS.
geometry::RigidTransform lps_motion(const Eigen::Matrix4d& ras, const std::filesystem::path& path,
                                    const std::string& name, int item) {
  constexpr double rounded = 1e-4;
  const Eigen::DiagonalMatrix<double, 4> lps_from_ras(-1, -1, 1, 1);
  const Eigen::Matrix4d matrix = lps_from_ras * ras * lps_from_ras;
  const geometry::RigidTransform motion{matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>()};
  const bool is_rigid = matrix.allFinite() && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
                        (motion.rotation * motion.rotation.transpose()).isIdentity(rounded) &&
                        motion.rotation.determinant() > 0;
  if (!is_rigid)
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: item {}: \"{}\" is no rigid motion (rows of a rotation, last row "
                    "0 0 0 1)",
                    without_control_characters(path.string()), item, without_control_characters(name)));
  return motion;
}

bool is_word(std::string_view name) {
  return !name.empty() &&
         std::ranges::all_of(name, [](unsigned char c) { return std::isalnum(c) || c == '_'; });
}

void put_frame(std::string& out, std::size_t number, const SequenceFrame& frame) {
  const auto to = std::back_inserter(out);
  for (const auto& [name, pose] : frame.poses) {
    if (!is_word(name))
      throw BadInput(Reason::bad_value,
                     fmt::format("\"{}\" is not a valid transform name: use letters, digits and _",
                                 without_control_characters(name)));
    fmt::format_to(to, "Seq_Frame{:04}_{}Transform =", number, name);
    for (int row = 0; row < 4; ++row)
      for (int column = 0; column < 4; ++column) fmt::format_to(to, " {}", pose.matrix(row, column));
    fmt::format_to(to, "\nSeq_Frame{:04}_{}TransformStatus = {}\n", number, name,
                   pose.visible ? "OK" : "INVALID");
  }
  fmt::format_to(to, "Seq_Frame{:04}_Timestamp = {}\nSeq_Frame{:04}_ImageStatus = INVALID\n", number,
                 frame.time_s, number);
}

}  // namespace

Expected<std::vector<SequenceFrame>> read_sequence(const std::filesystem::path& path) {
  return guarded([&] {
    const std::string text = value_or_throw(read_file(path, max_sequence_bytes));
    try {
      return parse_sequence(text);
    } catch (const BadInput& bad) {
      Failure failure = bad.failure();
      failure.message = without_control_characters(path.string()) + ": " + failure.message;
      throw BadInput(std::move(failure));
    }
  });
}

Expected<TransformSequence> read_slicer_sequence(const std::filesystem::path& path) {
  return guarded([&] {
    const std::vector<SequenceFrame> frames = value_or_throw(read_sequence(path));
    TransformSequence read;
    for (const SequenceFrame& frame : frames) {
      for (const auto& [name, pose] : frame.poses) {
        auto& of = read.transforms[name];
        of.resize(read.index.size());
        of.push_back(pose.visible ? std::optional(lps_motion(pose.matrix, path, name, int(read.index.size())))
                                  : std::nullopt);
      }
      read.index.push_back(frame.time_s);
    }
    for (auto& [name, of] : read.transforms) of.resize(read.index.size());
    if (read.transforms.empty())
      throw BadInput(Reason::no_pose, without_control_characters(path.string()) + ": holds no transforms");
    return read;
  });
}

Expected<void> write_sequence(const std::filesystem::path& path, const std::vector<SequenceFrame>& frames) {
  return guarded([&] {
    std::string text = fmt::format(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = "
        "False\n"
        "DimSize = 0 0 {}\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\nOffset = 0 0 0\n"
        "TransformMatrix = 1 0 0 0 1 0 0 0 1\nKinds = domain domain list\n",
        frames.size());
    for (std::size_t i = 0; i < frames.size(); ++i) put_frame(text, i, frames[i]);
    text += "ElementDataFile = LOCAL\n";
    value_or_throw(write_file(path, text));
  });
}

}  // namespace helicarm::tracker

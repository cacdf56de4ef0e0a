// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/files.h"
#include "helicarm/devices/tracker/sequence_file.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

bool same(const tracker::RecordedPose& a, const tracker::RecordedPose& b) {
  for (int i = 0; i < 16; ++i) {
    const double x = a.matrix(i / 4, i % 4), y = b.matrix(i / 4, i % 4);
    if (x != y && !(std::isnan(x) && std::isnan(y))) return false;
  }
  return a.visible == b.visible;
}

}  // namespace

void run(std::string_view bytes) {
  const auto file = put_file("input.mha", bytes);
  if (const auto motions = tracker::read_slicer_sequence(file))
    for (const auto& [name, of] : motions->transforms) {
      check(of.size() == motions->index.size(), "each transform has one or none in each item");
      for (const auto& motion : of)
        check(!motion || std::abs(motion->rotation.determinant() - 1) < 1e-3,
              "a transform is a rigid motion");
    }
  const auto frames = tracker::read_sequence(file);
  if (!frames) return;
  const auto path = folder() / "written.mha";
  if (!tracker::write_sequence(path, *frames)) return;  // a name with invalid characters
  const auto again = tracker::read_sequence(path);
  check(again.has_value() && again->size() == frames->size(), "frames read back equal");
  for (std::size_t i = 0; i < frames->size(); ++i) {
    const tracker::SequenceFrame &one = (*frames)[i], &other = (*again)[i];
    check(std::abs(one.time_s) < 1e10, "times are bounded");
    check(one.poses.size() == other.poses.size(), "poses read back equal");
    for (const auto& [name, pose] : one.poses)
      check(other.poses.contains(name) && same(pose, other.poses.at(name)), "a pose reads back bit for bit");
  }
}

std::vector<std::string> seeds() {
  std::vector<tracker::SequenceFrame> frames(3);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].time_s = 0.1 * double(i);
    frames[i].poses["FemurToTracker"] = {Eigen::Matrix4d::Identity() * 1.5, i != 1};
  }
  std::vector<std::string> all{
      "ObjectType = Image\r\nDimSize = 0 0 2          \nSeq_Frame0000_ToolToTrackerTransform = 1 0 0 10 0 1 "
      "0 20 0 0 1 -3e-018 0 0 0 1 \nSeq_Frame0000_Timestamp = 12.5\nElementDataFile = LOCAL\nbinary"};
  if (tracker::write_sequence(folder() / "seed.mha", frames))
    all.push_back(read_file(folder() / "seed.mha", 1 << 20).value());
  return all;
}

}  // namespace helicarm::fuzz

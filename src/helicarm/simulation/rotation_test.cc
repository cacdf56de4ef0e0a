// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/rotation.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/image_file.h"

namespace helicarm::simulation {
namespace {

namespace fs = std::filesystem;

class SimulatedRotation : public testing::Test {
 protected:
  void TearDown() override { fs::remove_all(folder_); }

  const fs::path folder_ = fs::temp_directory_path() / ("helicarm_rotation_" + std::to_string(::getpid()));
};

const Rotation five{.frames = 5, .arc_deg = 120, .flex_mm = 2.5, .jitter_mm = 0.1};

SimulationOptions small_run() {
  SimulationOptions options;
  options.seed = 4;
  options.kind = CaseKind::flat;
  options.size = 256;
  options.knee = false;
  return options;
}

TEST_F(SimulatedRotation, RotationIsOneFileWithTheAngleOfEachFrame) {
  const SimulatedRun run = *simulate_run(small_run(), five);
  ASSERT_TRUE(write_run(folder_, run));
  const auto file = xray::ImageFile::open(folder_ / "RUN.dcm");
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ((*file)->frames(), 5);
  EXPECT_TRUE((*file)->check_angles());
  for (int i = 0; i < 5; ++i) {
    const auto frame = (*file)->read("RUN", i + 1);
    ASSERT_TRUE(frame) << frame.error().message;
    EXPECT_TRUE(std::ranges::equal(run.images.views[std::size_t(i)].pixels.pixels(), frame->pixels.pixels()));
    EXPECT_NEAR(*frame->acquisition.primary_angle_deg, -60 + 30 * i, 0.005);
    EXPECT_NEAR(*frame->acquisition.secondary_angle_deg, 0, 1e-9);
  }
  EXPECT_EQ((*read_json(folder_ / "case.json"))["views"],
            Json::array({{{"name", "RUN"}, {"image", "RUN.dcm"}, {"frames", "all"}}}));
  forget_case(folder_);
  EXPECT_TRUE(fs::is_empty(folder_));
}

/// Source and detector by the undeformed arm, the sag and the jitter in camera axes.
TEST_F(SimulatedRotation, TruthOfARotationHasSagAndJitterOfEachFrame) {
  Rotation rotation = five;
  const RunStand run = take_run(small_run(), rotation, 0, {});
  rotation.jitter_mm = 0;
  const RunStand still = take_run(small_run(), rotation, 0, {});
  rotation.flex_mm = 0;
  const RunStand stiff = take_run(small_run(), rotation, 0, {});
  double largest = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    const TrueView &shown = run.views[i], &flexed = still.views[i], &ideal = stiff.views[i];
    const Eigen::Matrix3d& axes = flexed.view.camera_from_world.rotation;
    const Displacement &flex = run.deviations[i].flex, &jitter = run.deviations[i].jitter;
    largest = std::max({largest, flex.source.norm(), flex.detector.norm()});
    const auto expect_apart = [&](const Eigen::Vector3d& apart, const Eigen::Vector3d& in_camera,
                                  double rolled_mm = 1e-9) {
      EXPECT_LT((axes * apart - in_camera).norm(), 0.03 * in_camera.norm() + rolled_mm);
    };
    // The sag rolls the image, up to a degree, whose middle is up to 6 mm off the central ray.
    constexpr double of_detector_mm = 0.11;
    expect_apart(flexed.view.source_in_world() - ideal.view.source_in_world(), flex.source);
    expect_apart(detector_in_calibrator(flexed) - detector_in_calibrator(ideal), flex.detector,
                 of_detector_mm);
    expect_apart(shown.view.source_in_world() - flexed.view.source_in_world(), jitter.source);
    expect_apart(detector_in_calibrator(shown) - detector_in_calibrator(flexed), jitter.detector);
    EXPECT_GT(jitter.source.norm(), 0);
  }
  EXPECT_NEAR(largest, 2.5, 1e-9);
}

TEST_F(SimulatedRotation, OptionsThatContradictItAreRefused) {
  SimulationOptions options = small_run();
  options.kind = CaseKind::tunnels;
  EXPECT_EQ(simulate_run(options, five).error().reason, Reason::usage);
  options = small_run();
  EXPECT_EQ(simulate_run(options, {.frames = 1}).error().reason, Reason::bad_value);
  EXPECT_EQ(simulate_case(options).error().reason, Reason::bad_value);  // 256 pixels
  options.faults = {Fault::wires};
  EXPECT_EQ(simulate_run(options, five).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::simulation

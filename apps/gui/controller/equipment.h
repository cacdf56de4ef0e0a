// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "gui/controller/application_state.h"
#include "helicarm/operation/connections.h"
#include "helicarm/pipeline/locate_case.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::gui {

/// What a source needs to live. The operation and the case belong to the worker; devices and the virtual room
/// may be used from any thread.
struct Equipment {
  std::unique_ptr<virtual_devices::VirtualDevices> virtual_or;
  std::unique_ptr<Connections> devices;
  std::unique_ptr<Operation> operation;
  TrackerPlan tracker;  ///< the operation's, for any thread
  std::optional<Case> given;
  std::optional<CaseCalibration> calibration;  ///< of `given`
  Method calibrated_by = Method::best;
  RunOptions options;
  std::optional<RobotOrder> last_order;
  RobotState rest;                    ///< where the robot was before it
  std::atomic<bool> stopped = false;  ///< no move of a tour may follow, no image is waited for
  std::atomic<virtual_devices::CArmFault> c_arm_fault = virtual_devices::CArmFault::none;
};

/// All views of the operation with the images taken so far.
using Images = std::vector<ViewResult>;

/// Shoots until the tracker has seen everything at rest. Refuses interrupted once `room.stopped`.
Expected<Images> shoot_and_take(Equipment& equipment, const std::string& view);
/// Takes an image that came by itself; its file may say that it is another view's.
Expected<Images> take(Equipment& equipment, const std::string& view, const DatedArrival& view_image);

/// A refused measurement still holds all that was found until then.
Expected<Result> measure(Equipment& equipment, const std::vector<Pick>& picks);

/// X-rays without tracker and robot, with the usual calibrator and plate; named as their files.
Expected<Case> case_of_images(const std::vector<std::filesystem::path>& images);

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>

#include "gui/desk/desk_state.h"
#include "helicarm/operating_room/virtual_room.h"
#include "helicarm/operation/connections.h"
#include "helicarm/pipeline/locate_case.h"

namespace helicarm::gui {

/// What a source needs to live. The operation and the case belong to the worker; devices and the virtual room
/// may be used from any thread.
struct Room {
  std::unique_ptr<operating_room::VirtualRoom> virtual_room;
  std::unique_ptr<Connections> devices;
  std::unique_ptr<Operation> operation;
  TrackerPlan tracker;  ///< the operation's, for any thread
  std::optional<Case> given;
  std::optional<CaseCalibration> calibration;  ///< of `given`
  Method calibrated_by = Method::best;
  RunOptions options;
  std::optional<RobotOrder> last_order;
  RobotState rest;                    ///< where the robot was before it
  std::atomic<bool> stopped = false;  ///< no move of a tour may follow, no picture is waited for
  std::atomic<operating_room::CArmFault> c_arm_fault = operating_room::CArmFault::none;
};

/// All views of the operation with the pictures taken so far.
using Pictures = std::vector<ViewResult>;

/// Shoots until the tracker has seen everything at rest. Refuses interrupted once `room.stopped`.
Expected<Pictures> shoot_and_take(Room& room, const std::string& view);
/// Takes a picture that came by itself; its file may say that it is another view's.
Expected<Pictures> take(Room& room, const std::string& view, const DatedArrival& picture);

/// A refused measurement still holds all that was found until then.
Expected<Result> measure(Room& room, const std::vector<Pick>& picks);

/// X-rays without tracker and robot, with the usual calibrator and plate; named as their files.
Expected<Case> case_of_pictures(const std::vector<std::filesystem::path>& pictures);

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <map>
#include <mutex>

#include "gui/controller/application_state.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/operation/connections.h"
#include "helicarm/pipeline/measure.h"
#include "helicarm/virtual_devices/virtual_devices.h"

namespace helicarm::gui {

/// The newest decision on a hand-held drill; from any thread.
class NewestGuidance {
 public:
  void set(std::optional<operation::Guidance> guidance);
  /// At this time (monotonic seconds). A decision that is not renewed is stale_pose.
  std::optional<operation::Guidance> at(double now_s) const;

 private:
  mutable std::mutex mutex_;
  std::optional<operation::Guidance> newest_;
  double set_s_ = 0;
};

/// Resources of a source. The operation and the case belong to the worker; devices and virtual devices may be
/// used from any thread.
struct Equipment {
  /// Records the end of the operation.
  ~Equipment() {
    if (operation) static_cast<void>(operation->finish());
  }

  std::unique_ptr<virtual_devices::VirtualDevices> virtual_or;
  std::unique_ptr<operation::Connections> devices;
  std::unique_ptr<operation::Operation> operation;
  operation::TrackerPlan tracker;  ///< of the operation; any thread may read it
  std::optional<pipeline::Case> the_case;
  std::optional<pipeline::Result> measurement;  ///< of `given`
  case_registration::RegisterOptions options;
  bool is_recorded = false;  ///< the case, of an operation, whose plan gives the options
  std::optional<case_registration::RegisterOptions> registered_by;  ///< of the registered models
  std::optional<robot::RobotOrder> last_order;
  robot::RobotState rest;  ///< the robot's state before the order
  NewestGuidance newest_guidance;
  std::atomic<bool> verifies = false;  ///< the guided drill is in its tunnel and shall be compared with it
  std::atomic<bool> stopped = false;   ///< no further move of a tour, no wait for an image
  std::atomic<virtual_devices::CArmFault> c_arm_fault = virtual_devices::CArmFault::none;
};

/// All views of the operation with the images received so far.
using Images = std::vector<pipeline::ViewResult>;

/// The images that an operation has taken, and whether it has measured them.
struct MeasuredImages {
  std::map<std::string, std::filesystem::path> files;  ///< by view
  bool have_result = false;
  bool operator==(const MeasuredImages&) const = default;
};
MeasuredImages measured_images(const operation::Operation& operation);

/// All views of an operation with their images. Fails as `read_xray_image`.
Expected<Images> images_of(const operation::Operation& operation);

/// With the images alone.
std::shared_ptr<const pipeline::Result> result_with(Images images);

/// Acquires an image until the tracker has valid poses at rest. Refuses interrupted once `equipment.stopped`.
Expected<Images> shoot_and_take(Equipment& equipment, const std::string& view);
/// Takes a received image; its file may assign it to another view.
Expected<Images> take(Equipment& equipment, const std::string& view,
                      const operation::DatedArrival& view_image);

/// A refused measurement contains the results up to the refusal.
Expected<pipeline::Result> measure(Equipment& equipment, const std::vector<pipeline::Pick>& picks);

inline constexpr std::size_t most_loose_images = 20;

/// Registers the case's models to its calibrated views. `landmarks`, placed in the models: as
/// `start_from_landmarks`. `starts`: of models that a person moved, in place of the case's.
/// `tell` is called with each step. Refuses interrupted once `equipment.stopped`.
Expected<case_registration::CaseRegistration> register_models(
    Equipment& equipment, const std::vector<pipeline::Pick>& picks, const ModelLandmarks& landmarks,
    const std::vector<operation::ModelStart>& starts,
    const std::function<void(const std::string& step)>& tell);

/// The models where their search would begin, by the calibration of `measured`, to be moved by hand.
Expected<case_registration::CaseRegistration> models_at_starts(Equipment& equipment,
                                                               const pipeline::Result& measured,
                                                               const std::vector<pipeline::Pick>& picks,
                                                               const ModelLandmarks& landmarks);

/// Images of files, for looking; each with its file.
struct LooseImages {
  Images images;
  std::vector<ViewFile> files;
  std::optional<Failure> unreadable;  ///< the first file that is not an image
};

/// Reads the files, of several frames the middle one. Views are named as `name_views` does. Refuses (usage)
/// more than `most_loose_images`, and fails as `inspect_image` if none is an image.
Expected<LooseImages> read_loose_images(const std::vector<std::filesystem::path>& files);

/// The files of a case's views; an unreadable one counts as one frame.
std::vector<ViewFile> files_of(const pipeline::Case& the_case);

}  // namespace helicarm::gui

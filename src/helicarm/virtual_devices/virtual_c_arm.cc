// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/virtual_c_arm.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <thread>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/scu.h>
#include <fmt/format.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/simulation/write_case.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::virtual_devices {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 7> c_arm_fault_words = {
    "none", "wrong_title", "breaks_off", "same_picture", "other_patient", "held_back", "no_tags"};

/// A C-arm's clock is not synchronised with this machine's.
constexpr double clock_ahead_s = 31.7;
constexpr std::chrono::seconds held_back_for{4};
constexpr double leg_moves_mm = 6;

xray::AcquisitionTime c_arm_now() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return {std::chrono::duration<double>(now).count() + clock_ahead_s, 1e-6, {}};
}

void move_leg(SimulatedScene& simulated_scene, double mm) {
  for (const char* bone : {"femur", "tibia"})
    simulated_scene.move_bone(bone, {Eigen::Matrix3d::Identity(), {0, mm, 0}});
}

void need(const OFCondition& done, const char* what) {
  if (done.bad())
    throw BadInput(Reason::not_connected, fmt::format("virtual C-arm: {}: {}", what, done.text()));
}

void send(const fs::path& file, const ImageReceiver& receiver, CArmFault fault) {
  DcmSCU sender;
  sender.setAETitle("VIRTUAL_C_ARM");
  sender.setPeerHostName(receiver.address.c_str());  // an OFString. NOLINT(readability-redundant-string-cstr)
  sender.setPeerPort(receiver.port);
  sender.setPeerAETitle(fault == CArmFault::wrong_title ? "SOMEBODY" : receiver.title.c_str());
  sender.setProgressNotificationMode(false);
  OFList<OFString> syntaxes;
  syntaxes.push_back(UID_LittleEndianExplicitTransferSyntax);
  need(sender.addPresentationContext(UID_XRayAngiographicImageStorage, syntaxes), "presentation context");
  need(sender.initNetwork(), "network");
  need(sender.negotiateAssociation(), "association");
  if (fault == CArmFault::breaks_off) {
    need(sender.abortAssociation(), "abort");
    throw BadInput(Reason::not_connected, "virtual C-arm: association aborted");
  }
  Uint16 status = 0;
  need(sender.sendSTORERequest(0, file.c_str(), nullptr, status), "image");
  if (status != 0)
    throw BadInput(Reason::not_connected,
                   fmt::format("virtual C-arm: the receiver refused the image with status {:04X}", status));
  need(sender.releaseAssociation(), "release");
}

}  // namespace

std::optional<CArmFault> c_arm_fault(const std::string& name) {
  const auto found = std::ranges::find(c_arm_fault_words, name);
  if (found == c_arm_fault_words.end()) return std::nullopt;
  return static_cast<CArmFault>(found - c_arm_fault_words.begin());
}

std::string c_arm_fault_names() {
  return fmt::format("{}", fmt::join(c_arm_fault_words.begin() + 1, c_arm_fault_words.end(), ", "));
}

Expected<void> shoot(SimulatedScene& simulated_scene, const std::string& view, const ImageReceiver& receiver,
                     CArmFault fault) {
  return guarded([&] {
    const auto& views = simulated_scene.simulated_case().views;
    const auto true_view = std::ranges::find(views, view, [](const auto& v) { return v.true_view.name; });
    if (true_view == views.end())
      throw BadInput(Reason::bad_value, fmt::format("view: there is no {}", view));
    std::size_t number = std::size_t(true_view - views.begin());
    if (fault == CArmFault::same_image) number = (number + 1) % views.size();
    xray::DerivedImage image = simulation::dicom_of(simulated_scene.simulated_case(), number);
    image.instance_uid.clear();  // each acquisition has its own
    if (fault == CArmFault::other_patient) {
      image.study_uid.clear();
      image.patient_id = "ANOTHER";
    }
    image.acquisition.acquired = c_arm_now();
    if (fault == CArmFault::no_tags) {
      image.acquisition.acquired.reset();
      image.acquisition.primary_angle_deg.reset();
      image.acquisition.secondary_angle_deg.reset();
    }
    const TemporaryFolder folder;
    const fs::path file = folder.path() / "shot.dcm";
    value_or_throw(xray::write_dicom(file, image));
    if (fault != CArmFault::held_back) return send(file, receiver, fault);
    move_leg(simulated_scene, leg_moves_mm);
    std::this_thread::sleep_for(held_back_for);
    const auto sent = guarded([&] { send(file, receiver, fault); });
    move_leg(simulated_scene, -leg_moves_mm);
    value_or_throw(sent);
  });
}

}  // namespace helicarm::virtual_devices

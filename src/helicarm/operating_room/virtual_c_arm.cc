// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operating_room/virtual_c_arm.h"

#include <algorithm>
#include <filesystem>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/scu.h>
#include <fmt/format.h>

#include "helicarm/simulation/write_case.h"

namespace helicarm::operating_room {
namespace {

namespace fs = std::filesystem;

/// A file of its own that goes again.
class PassingFile {
 public:
  explicit PassingFile(const DerivedImage& image) {
    std::string name = (fs::temp_directory_path() / "helicarm_shot_XXXXXX").string();
    if (!::mkdtemp(name.data()))
      throw BadInput(Reason::cannot_write, fmt::format("{}: cannot be made", name));
    folder_ = name;
    value_or_throw(write_dicom(path(), image));
  }
  ~PassingFile() {
    std::error_code ec;
    fs::remove_all(folder_, ec);
  }
  PassingFile(const PassingFile&) = delete;
  PassingFile& operator=(const PassingFile&) = delete;
  fs::path path() const { return folder_ / "shot.dcm"; }

 private:
  fs::path folder_;
};

void need(const OFCondition& done, const char* what) {
  if (done.bad())
    throw BadInput(Reason::not_connected, fmt::format("virtual C-arm: {}: {}", what, done.text()));
}

void send(const fs::path& file, const PictureReceiver& receiver, CArmFault fault) {
  DcmSCU sender;
  sender.setAETitle("VIRTUAL_C_ARM");
  sender.setPeerHostName(receiver.address.c_str());
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
    throw BadInput(Reason::not_connected, "virtual C-arm: broke the association off");
  }
  Uint16 status = 0;
  need(sender.sendSTORERequest(0, file.c_str(), nullptr, status), "picture");
  if (status != 0)
    throw BadInput(Reason::not_connected,
                   fmt::format("virtual C-arm: the receiver refused the picture with status {:04X}", status));
  need(sender.releaseAssociation(), "release");
}

}  // namespace

Expected<void> shoot(const Theatre& theatre, const std::string& view, const PictureReceiver& receiver,
                     CArmFault fault) {
  return guarded([&] {
    const auto& views = theatre.room().views;
    const auto shot = std::ranges::find(views, view, [](const auto& v) { return v.shot.name; });
    if (shot == views.end()) throw BadInput(Reason::bad_value, fmt::format("view: there is no {}", view));
    std::size_t number = std::size_t(shot - views.begin());
    if (fault == CArmFault::same_picture) number = (number + 1) % views.size();
    DerivedImage image = simulation::dicom_of(theatre.room(), number);
    image.instance_uid.clear();  // each exposure has one of its own
    if (fault == CArmFault::other_patient) {
      image.study_uid.clear();
      image.patient_id = "ANOTHER";
    }
    send(PassingFile(image).path(), receiver, fault);
  });
}

}  // namespace helicarm::operating_room

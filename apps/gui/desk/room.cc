// SPDX-License-Identifier: Apache-2.0
#include "gui/desk/room.h"

#include <thread>

#include <fmt/format.h>

#include "helicarm/phantom/plate.h"
#include "helicarm/xray/read_exposure.h"

namespace helicarm::gui {
namespace {

constexpr int most_shots = 3;
constexpr double picture_patience_s = 20, picture_glance_s = 0.1;
/// An exposure's poses are taken from the second and a half before it.
constexpr std::chrono::milliseconds before_exposure{1800};

}  // namespace

Expected<Pictures> take(Room& room, const std::string& view, const DatedArrival& picture) {
  return guarded([&] {
    value_or_throw(room.operation->take(view, picture.arrival, picture.time_s));
    const auto taken = room.operation->pictures();
    Pictures pictures;
    for (const std::string& name : room.operation->plan().views) {
      ViewResult shown;
      shown.name = name;
      if (const auto file = taken.find(name); file != taken.end())
        shown.exposure =
            std::make_shared<const Exposure>(value_or_throw(read_exposure(file->second, name, 1)));
      pictures.push_back(std::move(shown));
    }
    return pictures;
  });
}

namespace {

std::optional<DatedArrival> wait_for_picture(Room& room) {
  for (int glance = 0; glance * picture_glance_s < picture_patience_s && !room.stopped; ++glance)
    if (auto picture = room.devices->next_picture(picture_glance_s)) return picture;
  return std::nullopt;
}

}  // namespace

Expected<Pictures> shoot_and_take(Room& room, const std::string& view) {
  const operating_room::PictureReceiver receiver{"127.0.0.1", room.devices->receiver_port()};
  Expected<Pictures> taken = fail(Reason::not_connected, "no picture came");
  for (int shot = 0; shot < most_shots && !taken && !room.stopped; ++shot) {
    std::this_thread::sleep_for(before_exposure);
    const auto sent = operating_room::shoot(room.virtual_room->theatre(), view, receiver, room.c_arm_fault);
    if (!sent) return tl::unexpected<Failure>(sent.error());
    if (const auto picture = wait_for_picture(room)) taken = take(room, view, *picture);
  }
  if (!taken && room.stopped) return fail(Reason::interrupted, "cancelled");
  return taken;
}

Expected<Result> measure(Room& room, const std::vector<Pick>& picks) {
  if (room.given) {
    room.given->picks = picks;
    if (!room.calibration || room.calibrated_by != room.options.method) {
      auto calibration = calibrate_case(*room.given, room.options);
      if (!calibration) return result_of_refusal(*room.given, std::move(calibration).error(), room.options);
      room.calibration = *std::move(calibration);
      room.calibrated_by = room.options.method;
    }
    return locate_case(*room.given, *room.calibration, room.options);
  }
  Json json = Json::array();
  for (const Pick& pick : picks) json.push_back(helicarm::to_json(pick));
  room.operation->pick(std::move(json));
  const auto done = room.operation->measure();
  if (const auto& result = room.operation->newest_result()) return *result;
  return tl::unexpected<Failure>(done.error());
}

Expected<Case> case_of_pictures(const std::vector<std::filesystem::path>& pictures) {
  Case given;
  given.calibrator = udcsc();
  given.plate = plate48();
  for (const std::filesystem::path& picture : pictures) {
    if (!std::filesystem::exists(picture))
      return fail(Reason::missing_file, fmt::format("{}: no such file or folder", picture.string()));
    CaseView view;
    view.name = picture.stem().string();
    view.image = std::filesystem::absolute(picture);
    for (const CaseView& other : given.views)
      if (other.name == view.name)
        return fail(Reason::name_clash, fmt::format("{}: two pictures of this name", view.name));
    given.views.push_back(std::move(view));
  }
  if (given.views.size() < 2)
    return fail(Reason::usage, "one X-ray alone places nothing: drop two or more at once, or a case folder");
  return given;
}

}  // namespace helicarm::gui

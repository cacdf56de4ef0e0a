// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/file_lock.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom_calibration/verify_phantom.h"
#include "helicarm/xray/digest.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr std::size_t most_entries = 10000;
constexpr const char* format = "helicarm-phantom-history/1";

Json earlier_entries(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) return Json::array();
  const Json json = value_or_throw(read_json(path));
  JsonReader reader(json, path.filename().string());
  reader.choice("format", {format});
  for (JsonReader& entry : reader.objects("verifications", true, most_entries)) {
    entry.text("date");
    entry.text("calibrator");
    entry.text("status");
    entry.optional_number("within_mm", {0, 1e6});
    for (JsonReader& ball : entry.objects("balls", true)) {
      ball.text("label");
      ball.optional_number("distance_mm", {0, 1e6});
      ball.text("state");
      ball.finish();
    }
    entry.finish();
  }
  reader.finish();
  return json["verifications"];
}

}  // namespace

std::string digest_of(const phantom::Calibrator& calibrator) {
  Json places = Json::array();
  for (const phantom::CalibratorBall& ball : calibrator.balls) {
    const Eigen::Vector3d& c = ball.centre_in_calibrator;
    places.push_back({ball.label, c.x(), c.y(), c.z(), ball.diameter_mm});
  }
  return xray::digest(to_text(places));
}

Expected<void> add_to_history(const std::filesystem::path& path, const PhantomVerification& verification) {
  return guarded([&] {
    const FileLock lock = value_or_throw(FileLock::of(path));
    Json json = {{"format", format}, {"verifications", earlier_entries(lock.file())}};
    Json entry = {{"date", verification.date},
                  {"calibrator", verification.calibrator},
                  {"status", verification.failure ? "refused" : "ok"},
                  {"within_mm", verification.within_mm},
                  {"balls", Json::array()}};
    for (const VerifiedBall& ball : verification.balls)
      entry["balls"].push_back({{"label", ball.label},
                                {"distance_mm", ball.distance_mm ? Json(*ball.distance_mm) : Json(nullptr)},
                                {"state", word(ball.state)}});
    json["verifications"].push_back(std::move(entry));
    value_or_throw(write_file(lock.file(), to_text(json) + "\n"));
  });
}

}  // namespace helicarm::phantom_calibration

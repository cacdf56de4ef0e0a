// SPDX-License-Identifier: Apache-2.0
#include <array>

#include "helicarm/core/files.h"
#include "helicarm/pipeline/result.h"
#include "helicarm/track/model_sequence.h"
#include "helicarm/track/rows.h"
#include "helicarm/track/slicer_sequence.h"

namespace helicarm::track {

Json to_json(const ModelSequence& sequence) {
  const auto refusal = sequence.refusal();
  Json json = {{"format", "helicarm-sequence/1"},
               {"status", refusal ? "refused" : "ok"},
               {"failure", refusal ? pipeline::to_json(*refusal) : Json(nullptr)},
               {"warnings", Json::array()},
               {"frames", sequence.frames.size()},
               {"first_frame", sequence.frames.front()},
               {"last_frame", sequence.frames.back()},
               {"models", Json::array()}};
  for (const Warning& warning : sequence.warnings) json["warnings"].push_back(pipeline::to_json(warning));
  for (std::size_t i = 0; i < sequence.names.size(); ++i) {
    const BodySequence& body = sequence.bodies[i];
    std::array<int, 3> counts{};
    for (const auto& frame : sequence.registered) ++counts[std::size_t(frame.models[i].decision)];
    json["models"].push_back(
        {{"name", sequence.names[i]},
         {"accepted", counts[0]},
         {"warned", counts[1]},
         {"refused", counts[2]},
         {"noise_factor", body.prior ? Json(body.noise_factor) : Json(nullptr)},
         {"turn_noise_factor", body.prior ? Json(body.turn_noise_factor) : Json(nullptr)},
         {"prior", body.prior ? Json{{"turn_rad2_per_frame5", body.prior->turn},
                                     {"shift_mm2_per_frame5", body.prior->shift}}
                              : Json(nullptr)}});
  }
  json["seconds"] = sequence.seconds;
  json["version"] = HELICARM_VERSION;
  return json;
}

Expected<void> write_models(const ModelSequence& sequence, const std::filesystem::path& folder) {
  return guarded([&] {
    const auto write = [&](const char* name, const std::string& text) {
      value_or_throw(write_file(folder / name, text));
    };
    std::string poses = case_registration::poses_header();
    for (const auto& frame : sequence.registered) poses += case_registration::poses_rows(frame);
    write("registration.csv", poses);
    write("bodies.csv",
          bodies_table(sequence.frames, sequence.names, sequence.bodies, &BodySequence::frames));
    write("smoothed.csv",
          bodies_table(sequence.frames, sequence.names, sequence.bodies, &BodySequence::smoothed));
    write("relative.csv", relative_table(sequence.frames, sequence.names, sequence.relative));
    write("smoothed.seq.mha", slicer_sequence(sequence.names, sequence.frames, sequence.bodies, {}));
    write("report.html", model_report(sequence));
    write("sequence.json", to_text(to_json(sequence)) + "\n");
  });
}

}  // namespace helicarm::track

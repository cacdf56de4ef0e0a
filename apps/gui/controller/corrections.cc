// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/corrections.h"

#include <algorithm>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

/// Whether an element of case.json's picks is of a frame of the range behind the first.
bool is_later(const Json& pick, const case_registration::FrameRange& range) {
  if (!pick.is_object() || !pick.contains("frame") || !pick.at("frame").is_number_integer()) return false;
  const int frame = pick.at("frame").get<int>();
  return frame > range.first && frame <= range.last;
}

bool is_of(const Json& pick, const std::string& name, const std::string& view) {
  return pick.is_object() && pick.value("name", Json()) == Json(name) &&
         pick.value("view", Json()) == Json(view);
}

}  // namespace

void Corrections::set(const track::MarkerPick& pick, const case_registration::FrameRange& range) {
  earlier_.push_back(now_);
  const bool is_first = pick.frame == range.first;
  auto& picks = is_first ? now_.first : now_.later;
  track::MarkerPick made = pick;
  if (is_first) made.frame.reset();
  const auto same = std::ranges::find_if(picks, [&](const track::MarkerPick& other) {
    return other.marker == made.marker && other.view == made.view && other.frame == made.frame;
  });
  if (same == picks.end())
    picks.push_back(made);
  else
    *same = made;
}

void Corrections::undo() {
  if (!can_undo()) return;
  now_ = earlier_.back();
  earlier_.pop_back();
}

void Corrections::put_into(track::TrackCase& the_case) const {
  the_case.picks = now_.first;
  the_case.corrections = now_.later;
}

Expected<void> Corrections::save(const fs::path& case_folder, const track::TrackCase& the_case,
                                 const case_registration::FrameRange& range) const {
  const fs::path file = case_folder / "case.json";
  return read_json(file).and_then([&](Json json) {
    Json kept = Json::array();
    if (json.contains("picks") && json.at("picks").is_array())
      for (const Json& pick : json.at("picks"))
        if (!is_later(pick, range)) kept.push_back(pick);
    // A case whose markers were found keeps finding them, unless one of them is picked here.
    const bool is_picked =
        std::ranges::any_of(kept,
                            [&](const Json& pick) {
                              return !pick.contains("frame") || pick.at("frame") == Json(range.first);
                            }) ||
        std::ranges::any_of(earlier_, [&](const State& state) { return state.first != now_.first; });
    for (const track::MarkerPick& pick : now_.first) {
      if (!is_picked) break;
      const std::string &name = the_case.markers[pick.marker], &view = the_case.views[pick.view].images.name;
      const Json made = {
          {"name", name}, {"view", view}, {"frame", range.first}, {"uv", {pick.uv_raw.x(), pick.uv_raw.y()}}};
      const auto same = std::find_if(kept.begin(), kept.end(), [&](const Json& other) {
        return is_of(other, name, view) && other.value("frame", range.first) == range.first;
      });
      if (same == kept.end())
        kept.push_back(made);
      else
        (*same)["uv"] = made["uv"];
    }
    for (const track::MarkerPick& pick : now_.later)
      kept.push_back({{"name", the_case.markers[pick.marker]},
                      {"view", the_case.views[pick.view].images.name},
                      {"frame", *pick.frame},
                      {"uv", {pick.uv_raw.x(), pick.uv_raw.y()}}});
    json["picks"] = std::move(kept);
    return write_file_in_folder(file, to_text(json) + "\n");
  });
}

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/track.h"

#include <chrono>
#include <cstdint>
#include <future>
#include <locale>
#include <sstream>

#include <fmt/format.h>

#include "helicarm/core/csv.h"
#include "helicarm/core/files.h"
#include "helicarm/track/growing_table.h"
#include "helicarm/track/image_keys.h"
#include "helicarm/track/repeated_images.h"
#include "helicarm/track/rows.h"
#include "helicarm/track/sequence_images.h"
#include "helicarm/xray/digest.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;
constexpr std::uintmax_t most_bytes = std::uintmax_t(1) << 30;

/// A text that two cases share only if their sequences are the same.
std::string identity_of(const TrackCase& the_case, const case_registration::FrameRange& frames) {
  std::string text = fmt::format("{} {} {} {}", frames.first, frames.last, frames.step, the_case.diameter_mm);
  for (const TrackView& view : the_case.views) {
    text +=
        fmt::format("\n{} {} {}", view.images.name, view.images.image.filename().string(), view.frame_offset);
    const geometry::Projection projection = view.camera.projection();
    for (const double value : projection.reshaped()) text += fmt::format(" {}", value);
    if (view.map) text += rectification::to_json(*view.map).dump();
  }
  for (const std::string& marker : the_case.markers) text += "\n" + marker;
  for (const MarkerPick& pick : the_case.picks)
    text += fmt::format("\n{} {} {} {}", pick.marker, pick.view, pick.uv_raw.x(), pick.uv_raw.y());
  for (const BodyPlan& body : the_case.bodies) {
    text += "\n" + body.name;
    for (const std::size_t marker : body.markers) text += fmt::format(" {}", marker);
    for (const Eigen::Vector3d& place : body.geometry)
      text += fmt::format(" {} {} {}", place.x(), place.y(), place.z());
  }
  return xray::digest(text);
}

/// Its corrections, a line each.
std::string text_of(const std::vector<MarkerPick>& corrections) {
  std::string text;
  for (const MarkerPick& pick : corrections)
    text += fmt::format("\n{} {} {} {} {}", pick.frame.value_or(0), pick.marker, pick.view, pick.uv_raw.x(),
                        pick.uv_raw.y());
  return text;
}

/// In the order of `text_of`; up to a line that is none.
std::vector<MarkerPick> corrections_from(const std::string& text) {
  std::vector<MarkerPick> read;
  std::istringstream lines(text);
  lines.imbue(std::locale::classic());
  int frame = 0;
  MarkerPick pick;
  while (lines >> frame >> pick.marker >> pick.view >> pick.uv_raw.x() >> pick.uv_raw.y()) {
    pick.frame = frame;
    read.push_back(pick);
  }
  return read;
}

/// The first frame that one of them corrects and the other does not; nothing where they are the same.
std::optional<int> first_difference(const std::vector<MarkerPick>& some,
                                    const std::vector<MarkerPick>& others) {
  std::optional<int> first;
  for (const auto& [from, in] : {std::pair(&some, &others), std::pair(&others, &some)})
    for (const MarkerPick& pick : *from)
      if (std::ranges::find(*in, pick) == in->end() && (!first || *pick.frame < *first)) first = pick.frame;
  return first;
}

/// Without the frames from the first one on whose corrections are others.
void drop_corrected(std::vector<FrameSights>& kept, const std::vector<MarkerPick>& earlier,
                    const TrackCase& the_case, const TrackOptions& options) {
  const auto first = first_difference(earlier, the_case.corrections);
  if (!first) return;
  const auto from = std::ranges::find_if(kept, [&](const FrameSights& each) { return each.frame >= *first; });
  if (from == kept.end()) return;
  kept.erase(from, kept.end());
  if (options.on_note)
    options.on_note(
        fmt::format("frame {}: its picks are others than before: computed again from this frame", *first));
}

void warn_of_corrections(const TrackCase& the_case, Sequence& sequence) {
  for (const MarkerPick& pick : the_case.corrections)
    for (const FrameSights& frame : sequence.sights)
      if (frame.frame == pick.frame && !frame.of[pick.marker][pick.view])
        sequence.warnings.push_back(
            {Reason::target_not_found,
             fmt::format("frame {}: no marker near the pick \"{}\" at {:.1f}, {:.1f}: it counts as hidden in "
                         "this view",
                         frame.frame, the_case.markers[pick.marker], pick.uv_raw.x(), pick.uv_raw.y()),
             the_case.views[pick.view].images.name,
             {{"frame", double(frame.frame)}}});
}

/// Rows of the frames so far; those of the whole sequence replace them at its end.
struct GrowingTables {
  GrowingTable images, sights, markers, bodies;

  explicit GrowingTables(const fs::path& folder)
      : images(folder / "images.csv", image_keys_header()),
        sights(folder / "sights.csv", sights_header()),
        markers(folder / "markers.csv", markers_header()),
        bodies(folder / "bodies.csv", bodies_header()) {}

  void add(const FrameSights& seen, const ImageKeys& keys, const Tracker& tracker,
           const TrackCase& the_case) {
    std::string marker_rows, body_rows;
    const Tracker::Snapshot now = tracker.snapshot(seen);
    for (std::size_t m = 0; m < the_case.markers.size(); ++m)
      marker_rows += marker_row(seen.frame, the_case.markers[m], now.markers[m], the_case);
    for (std::size_t b = 0; b < the_case.bodies.size(); ++b)
      body_rows += body_row(seen.frame, csv_field(the_case.bodies[b].name), now.bodies[b]);
    markers.add(marker_rows);
    bodies.add(body_rows);
    images.add(image_keys_rows(seen.frame, names_of_views(the_case), keys));
    sights.add(sights_rows(seen, the_case));
  }
};

Expected<SequenceImages> open_images(const TrackCase& the_case, const case_registration::FrameRange& frames) {
  return SequenceImages::open(std::vector<SequenceView>(the_case.views.begin(), the_case.views.end()),
                              frames);
}

/// What looks like bright metal, as gaps between bones do, counts for less than the markers themselves.
bool undo_wrong_inversions(SequenceImages& images, const Tracker& tracker, std::size_t views) {
  bool is_any = false;
  for (std::size_t view = 0; view < views; ++view)
    if (images.is_inverted(view) && tracker.is_bright(view)) {
      images.undo_inversion(view);
      is_any = true;
    }
  return is_any;
}

/// The frames that an interrupted run left in the folder.
std::vector<FrameSights> kept_frames(const fs::path& folder, const TrackCase& the_case,
                                     const std::string& identity, const std::vector<int>& numbers,
                                     const TrackOptions& options) {
  std::error_code ignored;
  if (!fs::exists(folder / "sights.csv", ignored)) return {};
  const auto of = read_file(folder / "sights.id", most_bytes);
  if (!of || of->substr(0, of->find('\n')) != identity)
    throw BadInput(
        Reason::bad_value,
        fmt::format("--resume: {} holds rows of another sequence, case or range of frames: run without "
                    "--resume, or with another --out",
                    folder.string()));
  auto kept = sights_from(value_or_throw(read_file(folder / "sights.csv", most_bytes)), the_case, numbers);
  drop_corrected(kept, corrections_from(of->substr(identity.size())), the_case, options);
  return kept;
}

/// Of the images that these frames were seen in; empty where an earlier version wrote them.
std::vector<ImageKeys> kept_keys(const fs::path& folder, const TrackCase& the_case,
                                 const std::vector<int>& numbers) {
  const auto text = read_file(folder / "images.csv", most_bytes);
  return text ? image_keys_from(*text, names_of_views(the_case), numbers) : std::vector<ImageKeys>{};
}

/// From the points of a file instead of images.
Sequence placed_sequence(const TrackCase& the_case, const std::vector<int>& numbers,
                         const TrackOptions& options, const OnFrame& on_frame) {
  const auto begun = std::chrono::steady_clock::now();
  if (options.resume)
    throw BadInput(Reason::usage, "resume: the points of a file are placed again as quickly: leave it out");
  std::vector<FrameSights> sights;
  for (std::size_t f = 0; f < numbers.size(); ++f) {
    FrameSights& frame = sights.emplace_back(FrameSights{numbers[f], {}, 0});
    frame.of.resize(the_case.markers.size());
    for (std::size_t i = 0; i < the_case.points[f].size(); ++i) {
      auto& image = frame.of[i / the_case.views.size()].emplace_back();
      if (const auto& uv_raw = the_case.points[f][i]) image = MarkerImage{*uv_raw, the_case.point_sigma_px};
    }
  }
  Sequence sequence = estimate_sequence(the_case, sights);
  if (on_frame) on_frame(int(numbers.size()));
  sequence.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  return sequence;
}

}  // namespace

Expected<Sequence> run_track(const TrackCase& the_case, const case_registration::FrameRange& frames,
                             const TrackOptions& options, const OnFrame& on_frame) {
  return guarded([&] {
    const auto begun = std::chrono::steady_clock::now();
    const std::vector<int> numbers = frames.numbers();
    if (!the_case.points.empty()) return placed_sequence(the_case, numbers, options, on_frame);
    SequenceImages images = value_or_throw(open_images(the_case, frames));
    const std::string identity = identity_of(the_case, frames);
    std::vector<FrameSights> kept = options.kept;
    drop_corrected(kept, options.kept_corrections, the_case, options);
    if (options.out && options.resume) kept = kept_frames(*options.out, the_case, identity, numbers, options);
    auto first = value_or_throw(images.at(numbers.front()));
    RepeatedImages repeated;
    check_views_differ(names_of_views(the_case), numbers.front(), repeated.among(numbers.front(), first));
    Tracker tracker = value_or_throw(Tracker::begin(the_case, numbers.front(), first));
    if (undo_wrong_inversions(images, tracker, the_case.views.size())) {
      first = value_or_throw(images.at(numbers.front()));
      repeated = {};
      repeated.among(numbers.front(), first);
      tracker = value_or_throw(Tracker::begin(the_case, numbers.front(), first));
    }
    std::vector<ImageKeys> keys;
    const bool is_resumed = options.out && options.resume && !kept.empty();
    if (is_resumed) keys = kept_keys(*options.out, the_case, numbers);
    // An image that changed since then makes its frame, and those after it, another sequence.
    const auto keep_unchanged = [&](std::size_t i, const ImageKeys& now) {
      if (!is_resumed || i >= kept.size()) return;
      const std::string changed =
          changed_image(numbers[i], names_of_views(the_case), i < keys.size() ? keys[i] : ImageKeys{}, now);
      if (changed.empty()) return;
      kept.resize(i);
      if (options.on_note) options.on_note(changed);
    };
    ImageKeys now_keys = keys_of(first);
    keep_unchanged(0, now_keys);
    std::optional<GrowingTables> tables;
    if (options.out) {
      std::error_code ignored;
      fs::create_directories(*options.out, ignored);
      value_or_throw(write_file(*options.out / "sights.id", identity + text_of(the_case.corrections)));
      tables.emplace(*options.out);
    }
    std::vector<FrameSights> sights{tracker.first()};
    const auto done = [&] {
      if (tables) tables->add(sights.back(), now_keys, tracker, the_case);
      if (on_frame) on_frame(int(sights.size()));
    };
    done();
    // The next frame's images are read while this one's are searched.
    std::future<Expected<std::vector<xray::XrayImage>>> ahead;
    for (std::size_t i = 1; i < numbers.size(); ++i) {
      auto now = value_or_throw(ahead.valid() ? ahead.get() : images.at(numbers[i]));
      if (i + 1 < numbers.size())
        ahead = std::async(std::launch::async, [&images, next = numbers[i + 1]] { return images.at(next); });
      now_keys = keys_of(now);
      keep_unchanged(i, now_keys);
      auto of_others = repeated.among(numbers[i], now);
      for (const RepeatedImage& each : of_others) now[each.view].pixels = {};
      if (i < kept.size()) {
        sights.push_back(kept[i]);
      } else {
        sights.push_back(tracker.look(numbers[i], now));
      }
      for (const RepeatedImage& each : of_others)
        for (auto& of : sights.back().of) of[each.view].reset();
      sights.back().repeated = std::move(of_others);
      tracker.absorb(sights.back());
      done();
    }
    Sequence sequence = estimate_sequence(the_case, sights);
    sequence.warnings.insert(sequence.warnings.end(), images.warnings().begin(), images.warnings().end());
    sequence.warnings.insert(sequence.warnings.end(), tracker.warnings().begin(), tracker.warnings().end());
    sequence.sights = std::move(sights);
    warn_of_corrections(the_case, sequence);
    sequence.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return sequence;
  });
}

}  // namespace helicarm::track

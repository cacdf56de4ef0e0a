// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "helicarm/report/chart.h"
#include "helicarm/track/sequence.h"

namespace helicarm::track {

struct TrackOptions {
  std::optional<std::filesystem::path> out;  ///< folder for rows as they are computed; nothing: none are kept
  bool resume = false;                       ///< goes on after the rows in `out`
  /// `Sequence::sights` of the same case, from the first frame on: not looked at again, up to the first frame
  /// whose corrections are others than `kept_corrections`.
  std::vector<FrameSights> kept = {};
  std::vector<MarkerPick> kept_corrections = {};
  /// Told why rows of an interrupted run are computed again.
  std::function<void(const std::string&)> on_note = {};
};

/// Called after each frame, with the number of frames done.
using OnFrame = std::function<void(int done)>;

/// Follows the markers of a case through its frames, or takes its points, and estimates bodies and smooth
/// motion. Rows are written to `out` frame by frame: sights.csv, markers.csv and bodies.csv as far as they
/// are known until then. With `resume` the frames in sights.csv are not looked at again, up to one whose
/// image has changed, and the result is that of a run without an interruption; bad_value where they are of
/// another case. Fails as `SequenceImages` and `Tracker::begin`.
Expected<Sequence> run_track(const TrackCase& the_case, const case_registration::FrameRange& frames,
                             const TrackOptions& options = {}, const OnFrame& on_frame = {});

/// track.json (docs/formats.md); `refusal`: of a sequence that has no result.
Json to_json(const Sequence& sequence, const TrackCase& the_case);
Json refused_json(const Failure& refusal);

std::string markers_csv(const Sequence& sequence, const TrackCase& the_case);
std::string bodies_csv(const Sequence& sequence, const TrackCase& the_case);
std::string smoothed_csv(const Sequence& sequence, const TrackCase& the_case);
std::string relative_csv(const Sequence& sequence, const TrackCase& the_case);
/// The filtered places of each marker, [marker][frame]; empty without `butterworth`.
std::vector<std::vector<std::optional<Eigen::Vector3d>>> butterworth_places(const Sequence& sequence,
                                                                            const TrackCase& the_case);
/// butterworth.csv: `frame,name,x_mm,y_mm,z_mm`.
std::string butterworth_csv(const Sequence& sequence, const TrackCase& the_case);
std::string angles_csv(const Sequence& sequence, const TrackCase& the_case);

/// XMALab's 2-D points: a row per frame, MARKER_CAM_X and MARKER_CAM_Y of each marker and view, raw
/// (distorted) pixels from 0 with y downwards, NaN where not seen; its defaults on import.
std::string points2d_csv(const Sequence& sequence, const TrackCase& the_case);
/// XMALab's 3-D points: MARKER_X, MARKER_Y, MARKER_Z, mm.
std::string points3d_csv(const Sequence& sequence, const TrackCase& the_case);
/// Autoscoper's tracking of a body: a row per frame, the 16 numbers of its smoothed pose by rows, mm.
std::string tra_of(const BodySequence& body);

/// Curves of the report that belong together, with 95 % bars.
struct CurveSheet {
  std::string title;  ///< body, or body / reference
  std::vector<report::Chart> charts;
};
/// Of each body, of each further body in the first one, and of each joint.
std::vector<CurveSheet> curve_sheets(const Sequence& sequence, const TrackCase& the_case);

/// report.html as one page.
std::string track_report(const Sequence& sequence, const TrackCase& the_case);

/// Writes everything into the folder.
Expected<void> write_track(const Sequence& sequence, const TrackCase& the_case,
                           const std::filesystem::path& folder);

/// Removes what `write_track` and `run_track` wrote into the folder earlier.
void forget_track(const std::filesystem::path& folder);

}  // namespace helicarm::track

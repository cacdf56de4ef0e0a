// SPDX-License-Identifier: Apache-2.0
#include "gui/xray/mark_groups.h"

namespace helicarm::gui {

report::ViewMarks only(MarkGroups groups, report::ViewMarks marks) {
  if (!groups.testFlag(MarkGroup::residuals))
    for (report::BallMark& ball : marks.balls) ball.residual.reset();
  if (!groups.testFlag(MarkGroup::fiducials)) marks.balls.clear();
  if (!groups.testFlag(MarkGroup::plate)) marks.plate_dots.clear();
  if (!groups.testFlag(MarkGroup::outliers)) {
    marks.false_blobs.clear();
    marks.candidates.clear();
    marks.guessed.clear();
  }
  if (!groups.testFlag(MarkGroup::points)) {
    marks.points.clear();
    marks.tunnels.clear();
    marks.tool_lines.clear();
  }
  if (!groups.testFlag(MarkGroup::labels)) {
    for (report::BallMark& ball : marks.balls) ball.label.clear();
    for (report::BallMark& guess : marks.guessed) guess.label.clear();
    for (report::PointMark& point : marks.points) point.name.clear();
  }
  return marks;
}

}  // namespace helicarm::gui

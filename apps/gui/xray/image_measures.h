// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <QStringList>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/measures/drawing.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::gui {

/// A click of a measure, raw px.
struct RawClick {
  std::string name;
  Eigen::Vector2d raw;
};

/// A measure in one X-ray image; may still lack clicks.
struct ImageMeasure {
  int number = 0;
  measures::Kind kind;
  std::string image;  ///< digest of its pixels
  std::vector<RawClick> clicks = {};
  bool without_optional = false;  ///< its optional clicks are left out
};

/// The role that the next click of a measure has; nothing: a further one, if its kind takes any.
const measures::Role* next_role(const ImageMeasure& measure);
/// Number of the clicks that have roles.
std::size_t required_clicks(const ImageMeasure& measure);
/// Whether it has all clicks that it needs, and whether it takes another one.
bool is_complete(const ImageMeasure& measure);
bool takes_clicks(const ImageMeasure& measure);

/// The plane in which lengths are measured.
struct LengthPlane {
  std::string point = {};               ///< through this located point; empty: see depth_mm
  std::optional<double> depth_mm = {};  ///< from the source; nothing: through the fiducials' centre
};

/// A line of a list of results: which measure, what, its value and 95 % interval, each with a unit.
struct MeasuredLine {
  int number;
  QString kind, view, what, value, within;
};

/// A measure evaluated in a view.
struct EvaluatedMeasure {
  std::string image = {};
  int number = 0;
  std::vector<MeasuredLine> lines = {};        ///< one with the reason where it is refused
  std::vector<measures::Stroke> strokes = {};  ///< rectified px
  std::vector<Eigen::Vector2d> points = {};    ///< the clicks
  QString label = {};                          ///< at the last click
  /// Points given in per cent, rectified px, and their words.
  std::vector<std::pair<Eigen::Vector2d, QString>> positions = {};
};

/// Evaluates in the view that shows its image; empty if the result has none. Lengths are in mm in a
/// calibrated view, else in px. Quadrants and tibial percentages also give the points picked in this view,
/// except those of the other bone.
EvaluatedMeasure evaluated(const ImageMeasure& measure, const pipeline::Result& result,
                           const LengthPlane& plane);

/// The lines as text with tabs, with a header.
QString table_text(const std::vector<MeasuredLine>& lines);

}  // namespace helicarm::gui

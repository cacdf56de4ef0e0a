// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <optional>

#include "gui/xray/layers.h"
#include "helicarm/report/marks.h"

namespace helicarm::gui {

/// All marks of one view, in the pixels of the layer.
report::ViewMarks marks_of(const pipeline::Result& result, std::size_t view, Layer layer);

/// Converts a position or path from rectified pixels to the layer; empty outside the map's range. A path is
/// clipped at the image border.
std::optional<Eigen::Vector2d> in_layer(const pipeline::ViewResult& view, Layer layer,
                                        const Eigen::Vector2d& rectified);
std::vector<rectification::PixelPath> in_layer(const pipeline::ViewResult& view, Layer layer,
                                               const rectification::PixelPath& rectified);

/// Conversion to raw pixels and back; empty outside the image or the map's range.
std::optional<Eigen::Vector2d> raw_from_layer(const pipeline::ViewResult& view, Layer layer,
                                              const Eigen::Vector2d& place);
std::optional<Eigen::Vector2d> layer_from_raw(const pipeline::ViewResult& view, Layer layer,
                                              const Eigen::Vector2d& raw);

/// A fiducial, point, or candidate under the cursor.
struct MarkUnderCursor {
  enum class Kind { ball, point, candidate } kind;
  Eigen::Vector2d place;
  QString name;
  QString tip;  ///< name, error and residual
  bool operator==(const MarkUnderCursor&) const = default;
};

/// The nearest fiducial, point or candidate within `reach_px`.
std::optional<MarkUnderCursor> mark_near(const report::ViewMarks& marks, const Eigen::Vector2d& place,
                                         double reach_px);

/// Content of a view in one sentence, for a screen reader.
QString described(const report::ViewMarks& marks);

}  // namespace helicarm::gui

// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <QString>
#include <optional>

#include "gui/xray/layers.h"
#include "helicarm/report/marks.h"

namespace helicarm::gui {

/// All there is to draw over one view, in the pixels of the layer.
ViewMarks marks_of(const Result& result, std::size_t view, Layer layer);

/// A place or a path in rectified pixels, in those of the layer; nothing where the map does not reach. A path
/// is cut where it leaves the image.
std::optional<Eigen::Vector2d> in_layer(const ViewResult& view, Layer layer,
                                        const Eigen::Vector2d& rectified);
std::vector<PixelPath> in_layer(const ViewResult& view, Layer layer, const PixelPath& rectified);

/// To raw pixels and back; nothing off the image or where the map does not reach.
std::optional<Eigen::Vector2d> raw_from_layer(const ViewResult& view, Layer layer,
                                              const Eigen::Vector2d& place);
std::optional<Eigen::Vector2d> layer_from_raw(const ViewResult& view, Layer layer,
                                              const Eigen::Vector2d& raw);

/// A ball or point under the cursor.
struct MarkUnderCursor {
  enum class Kind { ball, point } kind;
  std::size_t index;  ///< among the marks' balls or points
  QString name;
  QString tip;  ///< name, error, residual, in a few lines
  bool operator==(const MarkUnderCursor&) const = default;
};

/// The nearest ball or point within `reach_px`.
std::optional<MarkUnderCursor> mark_near(const ViewMarks& marks, const Eigen::Vector2d& place,
                                         double reach_px);

/// What a view shows, in one sentence for a screen reader.
QString described(const ViewMarks& marks);

}  // namespace helicarm::gui

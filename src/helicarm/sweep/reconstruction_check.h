// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/image/image.h"

namespace helicarm::sweep {

struct Sweep;
struct SweepCase;

/// Ends of a straight wire, mm, calibrator frame.
struct Wire {
  Eigen::Vector3d from, to;
};

struct CheckOptions {
  std::optional<Wire> wire = {};
  std::vector<exchange::ImportedMatrix> against = {};  ///< cameras of another program
  std::string program = "plastimatch";
  unsigned threads = 0;
};

/// One target by one geometry.
struct CheckedImage {
  std::optional<double> width_mm;    ///< at half maximum; nothing: not distinct from what is around it
  image::Image<std::uint8_t> slice;  ///< across the axis, or across the wire
  double side_mm = 0;                ///< of the slice
};

/// A ball or the wire, with this geometry, the ideal circle's and, where given, the other program's.
struct CheckedTarget {
  std::string name;
  std::optional<double> diameter_mm;  ///< of a ball
  CheckedImage own, circle;
  std::optional<CheckedImage> other;
};

/// Targets that were reconstructed to compare geometries.
struct ReconstructionCheck {
  std::string program;  ///< its version
  int images = 0;       ///< that were used
  std::vector<CheckedTarget> targets;

  /// Median over the targets of the width by the ideal circle, or by the other program's cameras, over this
  /// geometry's; nothing where none has both.
  std::optional<double> circle_ratio() const;
  std::optional<double> other_ratio() const;
};

/// "x,y,z;x,y,z"; bad_value otherwise.
Expected<Wire> wire_from(const std::string& text);

/// Reconstructs up to four balls and the wire from the accepted images. The ideal circle is the orbit that
/// fits these cameras best: one radius, one detector, the images' own angles. Refuses missing_file where
/// there is no such program, too_few_views for a run that turns by less than 180 degrees, bad_value for
/// cameras of another number of images; fails as `reconstruct`. `progress`: share that is done.
Expected<ReconstructionCheck> check_reconstruction(const SweepCase& the_case, const Sweep& sweep,
                                                   const CheckOptions& options,
                                                   const std::function<void(double)>& progress = {});

/// target,diameter_mm,width_mm,circle_width_mm,other_width_mm a line.
std::string check_csv(const ReconstructionCheck& check);

/// A section of the report: table and slices.
std::string check_html(const ReconstructionCheck& check);

}  // namespace helicarm::sweep

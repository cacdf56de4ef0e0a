// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/test_grid.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_crosses.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/rectification/lattice.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;
using Eigen::Vector2i;
using Complex = std::complex<double>;
using ComplexPoints = std::vector<Complex>;

struct IdealGrid {
  ComplexPoints places;
  double pitch = 0;
};

/// In the plane a similarity is w = scale z + shift with complex numbers; its least-squares fit is one
/// division.
IdealGrid ideal_grid(const ComplexPoints& ideal, const ComplexPoints& seen,
                     const std::vector<std::size_t>& central) {
  Complex ideal_middle;
  Complex seen_middle;
  for (const std::size_t k : central) {
    ideal_middle += ideal[k] / double(central.size());
    seen_middle += seen[k] / double(central.size());
  }
  Complex mixed;
  double squares = 0;
  for (const std::size_t k : central) {
    mixed += std::conj(ideal[k] - ideal_middle) * (seen[k] - seen_middle);
    squares += std::norm(ideal[k] - ideal_middle);
  }
  const Complex scale = mixed / squares;
  IdealGrid grid{{}, std::abs(scale)};
  for (const Complex& place : ideal) grid.places.push_back(seen_middle + scale * (place - ideal_middle));
  return grid;
}

std::vector<double> distances(const ComplexPoints& p, const ComplexPoints& q) {
  std::vector<double> between;
  for (std::size_t k = 0; k < p.size(); ++k) between.push_back(std::abs(p[k] - q[k]));
  return between;
}

GridError summed(const std::vector<double>& errors) {
  GridError error;
  for (const double e : errors) {
    error.mean_px += e / double(errors.size());
    error.max_px = std::max(error.max_px, e);
  }
  return error;
}

Complex complex_of(const Vector2d& p) { return {p.x(), p.y()}; }

struct PlaceLess {
  bool operator()(const Vector2i& p, const Vector2i& q) const {
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  }
};
using Grid = std::map<Vector2i, detection::Dot, PlaceLess>;

/// A missing crossing predicted by its neighbours in one direction: between two, or beyond two.
std::optional<Vector2d> predicted(const Grid& grid, const Vector2i& at, const Vector2i& step) {
  const auto place = [&](int k) -> std::optional<Vector2d> {
    const auto found = grid.find(at + k * step);
    return found == grid.end() ? std::nullopt : std::optional(found->second.centre_px);
  };
  if (place(-1) && place(1)) return 0.5 * (*place(-1) + *place(1));
  for (const int side : {1, -1})
    if (place(side) && place(2 * side)) return 2 * *place(side) - *place(2 * side);
  return std::nullopt;
}

/// All wires of a grid have one width. False crossings (a wire at the edge of the field, a wire behind a
/// plate dot) are wider, much less sharp or fitted badly; the factors separate both kinds on simulated
/// images.
struct Likeness {
  double radius_px = 0;
  double sigma_px = 0;
  double misfit = 0;

  explicit Likeness(const std::vector<detection::Dot>& crosses) {
    std::vector<double> radii;
    std::vector<double> sigmas;
    std::vector<double> misfits;
    for (const detection::Dot& cross : crosses) {
      radii.push_back(cross.radius_px);
      sigmas.push_back(cross.sigma_px);
      misfits.push_back(cross.misfit);
    }
    if (crosses.empty()) return;
    radius_px = median(radii);
    sigma_px = median(sigmas);
    misfit = median(misfits);
  }
  bool fits(const detection::Dot& cross) const {
    return cross.radius_px > 0.6 * radius_px && cross.radius_px < 1.7 * radius_px &&
           cross.misfit < 2 * misfit;
  }
  bool holds(const detection::Dot& cross) const { return fits(cross) && cross.sigma_px < 4 * sigma_px; }

 private:
};

/// Plate dots that cover crossings: those found, and those that a wire hides from the search, between or
/// beyond two others.
std::vector<detection::Disc> plate_dots(const xray::XrayImage& xray_image, const Grid& crossings) {
  std::vector<detection::Dot> found = detection::find_dots(xray_image, {});
  std::erase_if(found, [&](const detection::Dot& dot) {
    return dot.misfit >= 0.15 || std::any_of(crossings.begin(), crossings.end(), [&](const auto& entry) {
             return (entry.second.centre_px - dot.centre_px).norm() < 0.6 * dot.radius_px;
           });
  });
  std::vector<detection::Disc> discs;
  for (const detection::Dot& dot : found) discs.push_back({dot.centre_px, dot.radius_px + 2});
  const IndexedLattice lattice = index_lattice(found, phantom::Lattice::square, {});
  Grid plate;
  for (const IndexedDot& d : lattice.dots) plate[d.index] = found[d.dot];
  std::set<Vector2i, PlaceLess> missing;
  for (const auto& [at, dot] : plate)
    for (const Vector2i& step : {Vector2i(1, 0), Vector2i(-1, 0), Vector2i(0, 1), Vector2i(0, -1)})
      if (!plate.contains(at + step)) missing.insert(at + step);
  for (const Vector2i& at : missing)
    for (const Vector2i& step : {Vector2i(1, 0), Vector2i(0, 1)})
      if (const auto place = predicted(plate, at, step))
        discs.push_back({*place, plate.begin()->second.radius_px + 3});
  return discs;
}

}  // namespace

std::vector<detection::Dot> find_grid(const xray::XrayImage& xray_image) {
  std::vector<detection::Dot> crosses = detection::find_crosses(xray_image, {});
  const Likeness alike(crosses);
  std::erase_if(crosses, [&](const detection::Dot& cross) { return !alike.holds(cross); });
  const IndexedLattice lattice = index_lattice(crosses, phantom::Lattice::square, {});
  if (lattice.dots.empty()) return crosses;
  Grid grid;
  Vector2i low = lattice.dots.front().index;
  Vector2i high = low;
  for (const IndexedDot& d : lattice.dots) {
    grid[d.index] = crosses[d.dot];
    low = low.cwiseMin(d.index);
    high = high.cwiseMax(d.index);
  }
  const std::vector<detection::Disc> dots = plate_dots(xray_image, grid);
  const detection::Dot typical = grid.begin()->second;
  std::vector<detection::Dot> complete;
  for (int j = low.y(); j <= high.y(); ++j)
    for (int i = low.x(); i <= high.x(); ++i) {
      const Vector2i at(i, j);
      detection::Dot start = typical;
      const auto known = grid.find(at);
      if (known != grid.end()) {
        start = known->second;
      } else {
        const auto along_i = predicted(grid, at, {1, 0});
        const auto along_j = predicted(grid, at, {0, 1});
        if (!along_i && !along_j) continue;
        start.centre_px = along_i && along_j ? 0.5 * (*along_i + *along_j) : along_i.value_or(*along_j);
      }
      const bool disturbed = std::any_of(dots.begin(), dots.end(), [&](const detection::Disc& disc) {
        return (disc.centre - start.centre_px).norm() < disc.radius + 4 * start.radius_px + 4;
      });
      if (known != grid.end() && !disturbed) {
        complete.push_back(start);
        continue;
      }
      const auto angle_of = [&](const Vector2i& step, double fallback) {
        for (const int side : {1, -1})
          if (const auto next = grid.find(at + side * step); next != grid.end()) {
            const Vector2d d = side * (next->second.centre_px - start.centre_px);
            return std::atan2(d.y(), d.x());
          }
        return fallback;
      };
      const auto cross = detection::fit_cross(xray_image, start, angle_of({1, 0}, 0),
                                              angle_of({0, 1}, std::numbers::pi / 2), dots);
      if (cross && (cross->centre_px - start.centre_px).norm() < 0.05 * lattice.pitch_px &&
          cross->sigma_px < 0.5 && alike.fits(*cross))
        complete.push_back(*cross);
    }
  return complete;
}

Expected<TestGrid> measure_test_grid(const std::vector<detection::Dot>& crosses, const DistortionMap& map,
                                     GridFit fit) {
  const IndexedLattice lattice = index_lattice(crosses, phantom::Lattice::square, {});
  TestGrid grid;
  std::vector<Vector2i> indices;
  for (const IndexedDot& d : lattice.dots) {
    const Vector2d raw = crosses[d.dot].centre_px;
    const auto rectified = map.rectified_from_raw(raw);
    if (!rectified) continue;
    grid.raw_px.push_back(raw);
    grid.rectified_px.push_back(*rectified);
    indices.push_back(d.index);
  }
  grid.crosses = static_cast<int>(indices.size());
  // The centre is the crossing nearest to the image centre that has all eight neighbours.
  const Vector2d middle(0.5 * (map.width - 1), 0.5 * (map.height - 1));
  std::vector<std::size_t> central;
  double nearest = 1e9;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    std::vector<std::size_t> nine;
    for (std::size_t k = 0; k < indices.size(); ++k)
      if ((indices[k] - indices[i]).cwiseAbs().maxCoeff() <= 1) nine.push_back(k);
    if (const double distance = (grid.raw_px[i] - middle).norm(); nine.size() == 9 && distance < nearest) {
      nearest = distance;
      central = nine;
    }
  }
  if (central.empty())
    return fail(
        Reason::too_few_fiducials,
        fmt::format("{} crossings on a grid were found, but no 3 x 3 block at its centre", grid.crosses),
        {{"crosses", double(grid.crosses)}});
  if (fit == GridFit::all) {
    central.resize(indices.size());
    std::iota(central.begin(), central.end(), std::size_t{0});
  }
  ComplexPoints ideal;
  ComplexPoints raw;
  ComplexPoints rectified;
  for (std::size_t k = 0; k < indices.size(); ++k) {
    ideal.push_back(complex_of(indices[k].cast<double>()));
    raw.push_back(complex_of(grid.raw_px[k]));
    rectified.push_back(complex_of(grid.rectified_px[k]));
  }
  const ComplexPoints raw_ideal = ideal_grid(ideal, raw, central).places;
  for (const Complex& place : raw_ideal) grid.raw_ideal_px.emplace_back(place.real(), place.imag());
  grid.raw_error_px = distances(raw, raw_ideal);
  const IdealGrid rectified_ideal = ideal_grid(ideal, rectified, central);
  grid.rectified_pitch_px = rectified_ideal.pitch;
  grid.rectified_error_px = distances(rectified, rectified_ideal.places);
  grid.raw = summed(grid.raw_error_px);
  grid.rectified = summed(grid.rectified_error_px);
  return grid;
}

Expected<void> check_pitch(const TestGrid& grid, double pitch_mm, const DistortionMap& map,
                           std::optional<double> source_detector_mm) {
  constexpr double highest_mm = 300;
  constexpr double nearest_source_mm = 700;  // of C-arms, where the image does not state it
  constexpr double pixel_tolerance = 0.05;   // of the nominal pixel size, and from plate to receiver
  if (!map.rectified_pixel_mm) return {};
  const double at_receiver_mm = grid.rectified_pitch_px * *map.rectified_pixel_mm;
  const double least_mm = (1 - pixel_tolerance) * at_receiver_mm *
                          (1 - highest_mm / source_detector_mm.value_or(nearest_source_mm));
  const double most_mm = (1 + pixel_tolerance) * at_receiver_mm;
  if (pitch_mm >= least_mm && pitch_mm <= most_mm) return {};
  return fail(
      Reason::bad_value,
      fmt::format("test grid: pitch {} mm, but the crossings are {:.1f} to {:.1f} mm apart for a grid 0 "
                  "to {} mm in front of the receiver; state the grid's pitch, or make the map of this "
                  "C-arm's plate",
                  pitch_mm, least_mm, most_mm, highest_mm),
      {{"pitch_mm", pitch_mm}, {"least_mm", least_mm}, {"most_mm", most_mm}});
}

}  // namespace helicarm::rectification

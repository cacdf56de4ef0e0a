// SPDX-License-Identifier: Apache-2.0
#include "studies/biplane.h"

#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/phantom/calibrator.h"
#include "studies/records.h"
#include "studies/statistics.h"

namespace helicarm::study {
namespace {

constexpr std::size_t experiments_of_block = 64;
constexpr int tests_of_experiment = 10;  // 3.2
constexpr double focal_length_mm = 900;

constexpr std::size_t cells_of_table = 10;

/// The table's cells in order, with the published values. The plates of the two views are in different
/// positions, so their own balls have no two rays: the error is that of one ray.
const std::array<BiplaneRow, cells_of_table> table_1{
    {{"udcsc", "fre", "intersection", {}, ErrorFigures{0.70, 0.05, 0.36, 0.43}},
     {"udcsc", "on_biplane", "intersection", {}, ErrorFigures{7.53, 3.30, 4.50, 4.68}},
     {"udcsc", "on_biplane", "ray", {}},
     {"udcsc", "centre", "intersection", {}, ErrorFigures{0.42, 0.18, 0.30, 0.42}},
     {"udcsc", "on_udcsc", "intersection", {}, ErrorFigures{1.15, 0.16, 0.54, 0.62}},
     {"biplane", "fre", "ray", {}, ErrorFigures{0.58, 0.03, 0.25, 0.32}},
     {"biplane", "on_biplane", "ray", {}, ErrorFigures{0.89, 0.20, 0.58, 0.65}},
     {"biplane", "on_biplane", "intersection", {}},
     {"biplane", "centre", "intersection", {}, ErrorFigures{3.08, 1.75, 2.65, 2.77}},
     {"biplane", "on_udcsc", "intersection", {}, ErrorFigures{3.33, 1.43, 2.04, 2.16}}}};

/// Errors of one cell over an experiment.
struct Gathered {
  Simd most{}, least = simd(1e300), sum{}, squares{};
  double count = 0;

  void add(Simd error) {
    most = larger(error, most);
    least = error < least ? error : least;
    sum += error;
    squares += error * error;
    ++count;
  }
  ErrorFigures figures(int lane) const {
    return {most[lane], least[lane], sum[lane] / count, std::sqrt(squares[lane] / count)};
  }
};

std::vector<Eigen::Vector3d> points_of_udcsc() {
  std::vector<Eigen::Vector3d> points;
  for (const phantom::CalibratorBall& ball : phantom::udcsc().balls)
    points.push_back(ball.centre_in_calibrator);
  return points;
}

/// The four check points of 3.2 on the cone's surface: left, right and two on the upper side.
std::vector<Eigen::Vector3d> surface_targets() {
  const double half = cone_height_mm / 2, side = (cone_base_mm + cone_top_mm) / 2;
  return {{side, 0, half}, {-side, 0, half}, {15, 0, cone_height_mm}, {-15, 0, cone_height_mm}};
}

/// The most nearly square lattice of n points, at least 2 x 2, in the square of +-1; empty if n has none.
std::vector<Eigen::Vector2d> lattice(int n) {
  for (int columns = int(std::ceil(std::sqrt(n))); 2 * columns <= n; ++columns) {
    if (n % columns != 0) continue;
    const int rows = n / columns;
    std::vector<Eigen::Vector2d> points;
    for (int j = 0; j < rows; ++j)
      for (int i = 0; i < columns; ++i)
        points.emplace_back(2.0 * i / (columns - 1) - 1, 2.0 * j / (rows - 1) - 1);
    return points;
  }
  return {};
}

class BiplaneTrials {
 public:
  explicit BiplaneTrials(const BiplaneOptions& options) : options_(options) {
    views_ = paper_views(WorldOrigin::centre);
    for (geometry::View& view : views_)
      view.camera_from_world.translation.z() +=
          options.cone_mm - 800;  // paper_views puts the centre at 800 mm
    for (std::size_t i = 0; i < 2; ++i) plates_[i] = plates_in_world(views_[i]);
    cone_ = points_of_udcsc();
    on_cone_ = cone_;
    for (const auto& target : surface_targets()) on_cone_.push_back(target);
  }

  /// Experiments first .. first + 3: the table's cells, four values each.
  void run(std::uint64_t first, std::span<double> out) const {
    std::array<Gathered, cells_of_table> cells;
    for (int test = 0; test < tests_of_experiment; ++test)
      run_test(SimdRandom(options_.seed, biplane_stream + std::uint32_t(test), first), cells);
    for (int lane = 0; lane < simd_width; ++lane)
      for (const Gathered& cell : cells) put_record(cell.figures(lane), out);
  }

 private:
  /// Points known to all lanes, with noisy pixels.
  struct Seen {
    std::vector<SimdPoint> points;
    std::vector<SimdPixel> pixels[2];
  };

  std::vector<Eigen::Vector3d> plates_in_world(const geometry::View& view) const {
    std::vector<Eigen::Vector3d> balls;
    for (const bool far : {false, true})
      for (Eigen::Vector2d share : lattice(options_.balls / 2)) {
        // Turned by 45 degrees and smaller, so that no ball hides another.
        if (far) share = 0.4 * Eigen::Vector2d(share.x() - share.y(), share.x() + share.y());
        const double depth = far ? options_.far_plate_mm : options_.near_plate_mm;
        Eigen::Vector3d in_camera;
        in_camera << share * options_.half_plate_mm * depth / focal_length_mm, depth;
        balls.push_back(view.camera_from_world.rotation.transpose() *
                        (in_camera - view.camera_from_world.translation));
      }
    return balls;
  }

  /// `at` is the first block of random words; it is advanced.
  Seen seen(const std::vector<Eigen::Vector3d>& points, const SimdRandom& random, std::uint32_t& at) const {
    const double sigma = sigma_px(options_.sigma, options_.fle);
    Seen result;
    for (const Eigen::Vector3d& point : points) {
      result.points.push_back({simd(point.x()), simd(point.y()), simd(point.z())});
      for (std::size_t view = 0; view < 2; ++view) {
        const Eigen::Vector2d pixel = views_[view].project(point);
        const auto [u, v] = random.normals(at++);
        result.pixels[view].push_back({pixel.x() + sigma * u, pixel.y() + sigma * v});
      }
    }
    return result;
  }

  /// Tracked pose of a view's plates.
  std::vector<SimdPoint> tracked(const Seen& plates, const SimdRandom& random, std::uint32_t& at) const {
    const auto a = random.normals(at++), b = random.normals(at++), c = random.normals(at++);
    const double angle = options_.tracker_sigma_deg * std::numbers::pi / 180;
    const SimdPoint turn{angle * a.first, angle * a.second, angle * b.first};
    SimdPoint middle{};
    for (const SimdPoint& ball : plates.points) {
      middle.x += ball.x / double(plates.points.size());
      middle.y += ball.y / double(plates.points.size());
      middle.z += ball.z / double(plates.points.size());
    }
    std::vector<SimdPoint> moved;
    for (const SimdPoint& ball : plates.points) {
      const SimdPoint out = ball - middle;  // rotated by a small angle
      moved.push_back({ball.x + turn.y * out.z - turn.z * out.y + options_.tracker_sigma_mm * b.second,
                       ball.y + turn.z * out.x - turn.x * out.z + options_.tracker_sigma_mm * c.first,
                       ball.z + turn.x * out.y - turn.y * out.x + options_.tracker_sigma_mm * c.second});
    }
    return moved;
  }

  void run_test(const SimdRandom& random, std::array<Gathered, cells_of_table>& cells) const {
    std::uint32_t at = 0;
    const Seen cone = seen(cone_, random, at);
    const Seen plates[2] = {seen(plates_[0], random, at), seen(plates_[1], random, at)};
    const Seen anew[2] = {seen(plates_[0], random, at), seen(plates_[1], random, at)};
    const Seen centre = seen({middle_of_cone()}, random, at);
    const Seen on_cone = seen(on_cone_, random, at);
    const std::vector<SimdPoint> told[2] = {tracked(plates[0], random, at), tracked(plates[1], random, at)};

    const SimdBalls cone_model(cone.points);
    const SimdProjection by_cone[2] = {cone_model.calibrate(cone.pixels[0]),
                                       cone_model.calibrate(cone.pixels[1])};
    const SimdProjection by_plates[2] = {SimdBalls(told[0]).calibrate(plates[0].pixels[0]),
                                         SimdBalls(told[1]).calibrate(plates[1].pixels[1])};
    const auto intersections = [](const SimdProjection(&views)[2], const Seen& s, Gathered& cell) {
      for (std::size_t i = 0; i < s.points.size(); ++i)
        cell.add(norm(intersect(views[0], s.pixels[0][i], views[1], s.pixels[1][i]) - s.points[i]));
    };
    const auto rays = [](const SimdProjection& view, const std::vector<SimdPixel>& pixels,
                         const std::vector<SimdPoint>& points, Gathered& cell) {
      for (std::size_t i = 0; i < points.size(); ++i) cell.add(ray_distance(view, pixels[i], points[i]));
    };
    intersections(by_cone, cone, cells[0]);
    intersections(by_cone, centre, cells[3]);
    intersections(by_cone, on_cone, cells[4]);
    intersections(by_plates, centre, cells[8]);
    intersections(by_plates, on_cone, cells[9]);
    for (std::size_t view = 0; view < 2; ++view) {
      intersections(by_cone, anew[view], cells[1]);
      rays(by_cone[view], anew[view].pixels[view], anew[view].points, cells[2]);
      rays(by_plates[view], plates[view].pixels[view], told[view], cells[5]);
      rays(by_plates[view], anew[view].pixels[view], told[view], cells[6]);
      intersections(by_plates, anew[view], cells[7]);
    }
  }

  BiplaneOptions options_;
  std::array<geometry::View, 2> views_;
  std::array<std::vector<Eigen::Vector3d>, 2> plates_;
  std::vector<Eigen::Vector3d> cone_, on_cone_;
};

Expected<void> check(const BiplaneOptions& o) {
  if (o.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  if (o.balls % 2 != 0 || o.balls < biplane_balls.low || o.balls > biplane_balls.high ||
      lattice(o.balls / 2).empty())
    return fail(
        Reason::bad_value,
        fmt::format("balls: {}; biplane takes an even number from {} to {} whose half fills a lattice "
                    "of at least 2 x 2, such as 8, 12, 32",
                    o.balls, biplane_balls.low, biplane_balls.high));
  if (auto checked = check_fields<BiplaneOptions>(biplane_fields, o, "study biplane"); !checked)
    return checked;
  if (!(o.far_plate_mm > o.near_plate_mm))
    return fail(Reason::bad_value, fmt::format("far_plate_mm: {}, must exceed near_plate_mm, {}",
                                               o.far_plate_mm, o.near_plate_mm));
  return {};
}

}  // namespace

Expected<std::vector<BiplaneRow>> study_biplane(const BiplaneOptions& options, const EngineOptions& engine,
                                                const Ranks& ranks) {
  if (const auto good = check(options); !good) return tl::unexpected<Failure>(good.error());
  const BiplaneTrials trials(options);
  constexpr std::size_t stride = cells_of_table * numbers_in<ErrorFigures>;
  StudySetting setting;
  setting.blocks = (options.groups + experiments_of_block - 1) / experiments_of_block;
  setting.values_per_block = experiments_of_block * stride;
  setting.work = [&](std::size_t block, std::span<double> values) {
    for (std::size_t i = 0; i < experiments_of_block; i += simd_width)
      if (const std::size_t first = block * experiments_of_block + i; first < options.groups)
        trials.run(first, values.subspan(i * stride));
  };
  setting.settle = [&](std::span<const double> values) {
    std::vector<double> medians;
    for (std::size_t figure = 0; figure < stride; ++figure) {
      std::vector<double> column;
      for (std::size_t i = 0; i < options.groups; ++i) column.push_back(values[i * stride + figure]);
      medians.push_back(column_statistics(column).median);
    }
    return medians;
  };
  const std::string identity =
      fmt::format("biplane {} groups {} seed {} sigma {} fle {} lengths {} {} {} {} balls {} tracker {} {}",
                  HELICARM_VERSION, options.groups, options.seed, name_of(options.sigma), options.fle,
                  options.cone_mm, options.near_plate_mm, options.far_plate_mm, options.half_plate_mm,
                  options.balls, options.tracker_sigma_mm, options.tracker_sigma_deg);
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    if (kept.empty()) return std::vector<BiplaneRow>{};
    std::vector<BiplaneRow> rows(table_1.begin(), table_1.end());
    std::span<const double> values = kept.front();
    for (BiplaneRow& row : rows) row.figures = take_record<ErrorFigures>(values);
    return rows;
  });
}

}  // namespace helicarm::study

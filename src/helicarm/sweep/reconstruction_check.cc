// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/reconstruction_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <mutex>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/sweep/estimate_frame.h"
#include "helicarm/sweep/path.h"
#include "helicarm/sweep/reconstruction.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

using geometry::View;
namespace fs = std::filesystem;

/// A box about a target, its z along the axis or the wire.
struct CheckBox {
  std::string name;
  std::optional<double> diameter_mm;  ///< nothing: a wire
  geometry::RigidTransform world_from_box;
  std::array<int, 3> size{0, 0, 0};
  double voxel_mm = 0;

  /// Half of the box's sides, mm.
  Eigen::Vector3d half() const { return Eigen::Vector3d(size[0], size[1], size[2]) * voxel_mm / 2; }
};

/// Cameras of the used frames.
using Cameras = std::vector<View>;

struct Geometries {
  std::vector<std::size_t> frames;  ///< of the case, that are used
  std::vector<Cameras> cameras;     ///< own, circle, and perhaps another program's
};

Cameras circle_of(const Cameras& own, const Sweep& sweep) {
  std::vector<PlacedCamera> placed_cameras;
  for (const View& view : own) placed_cameras.push_back(placed(view, sweep.detector));
  const OrbitFit fit = fit_orbit(placed_cameras, sweep.path->isocentre);
  Cameras circle;
  for (const double angle : fit.angles_deg) circle.push_back(view_of(fit.orbit.at(angle), sweep.detector));
  return circle;
}

/// A wire that the calibrator's file describes by its end.
std::optional<Wire> wire_of(const phantom::Calibrator& calibrator) {
  constexpr double least_mm = 5;
  for (const phantom::CalibratorTarget& target : calibrator.targets)
    if (target.kind == phantom::TargetKind::line_end && target.length_mm >= least_mm)
      return Wire{target.point_in_calibrator,
                  target.point_in_calibrator + target.length_mm * target.directions.front()};
  return {};
}

/// By the views' names, or as many as images are accepted or in the case, in their order.
Cameras other_cameras(const std::vector<exchange::ImportedMatrix>& read, const Sweep& sweep,
                      const std::vector<std::size_t>& frames) {
  Cameras cameras;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const std::string& name = sweep.frames[frames[k]].view;
    const auto named =
        std::ranges::find_if(read, [&](const exchange::ImportedMatrix& c) { return c.name == name; });
    if (named != read.end())
      cameras.push_back(named->view);
    else if (read.size() == frames.size())
      cameras.push_back(read[k].view);
    else if (read.size() == sweep.frames.size())
      cameras.push_back(read[frames[k]].view);
    else
      throw BadInput(
          Reason::bad_value,
          fmt::format("the other program's {} cameras: none is named {}; {} images are accepted of {}",
                      read.size(), name, frames.size(), sweep.frames.size()));
  }
  return cameras;
}

Geometries geometries_of(const Sweep& sweep, const CheckOptions& options) {
  Geometries all;
  Cameras own;
  for (std::size_t i = 0; i < sweep.frames.size(); ++i)
    if (sweep.frames[i].best) {
      all.frames.push_back(i);
      own.push_back(sweep.frames[i].best->view);
    }
  all.cameras = {own, circle_of(own, sweep)};
  if (!options.against.empty()) all.cameras.push_back(other_cameras(options.against, sweep, all.frames));
  return all;
}

geometry::RigidTransform box_at(const Eigen::Vector3d& middle, const Eigen::Vector3d& along) {
  return {Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), along).toRotationMatrix(), middle};
}

CheckBox box_of_wire(const Wire& wire) {
  constexpr double side_mm = 12, voxel_mm = 0.12;
  constexpr int across = int(side_mm / voxel_mm) + 1, slices = 5;
  return {"wire",
          {},
          box_at((wire.from + wire.to) / 2, (wire.to - wire.from).normalized()),
          {across, across, slices},
          voxel_mm};
}

/// A ball's box, without its neighbours.
CheckBox box_of_ball(const phantom::Calibrator& calibrator, std::size_t ball, const Eigen::Vector3d& axis) {
  constexpr double voxels_across = 14, surroundings = 3, least_surroundings_mm = 8, gap_mm = 0.5;
  const auto& at = calibrator.balls[ball];
  const double d = at.diameter_mm;
  double side = std::max(surroundings * d, d + least_surroundings_mm);
  for (const auto& other : calibrator.balls)
    if (&other != &at) {
      const double free =
          (other.centre_in_calibrator - at.centre_in_calibrator).norm() - other.diameter_mm / 2 - gap_mm;
      side = std::min(side, free * 2 / std::sqrt(3.0));
    }
  const double voxel = d / voxels_across;
  const int n = 2 * int(side / voxel / 2) + 1;
  return {at.label, d, box_at(at.centre_in_calibrator, axis), {n, n, n}, voxel};
}

std::vector<Eigen::Vector3d> corners_of(const CheckBox& box) {
  std::vector<Eigen::Vector3d> corners;
  for (int k = 0; k < 8; ++k) {
    const Eigen::Vector3d sign(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
    corners.emplace_back(box.world_from_box * sign.cwiseProduct(box.half()).eval());
  }
  return corners;
}

bool is_inside(const CheckBox& box, const View& view, const Eigen::Vector2i& size) {
  return std::ranges::all_of(corners_of(box), [&](const Eigen::Vector3d& corner) {
    const Eigen::Vector2d at = view.project(corner);
    return at.minCoeff() > 0 && at.x() < size.x() - 1 && at.y() < size.y() - 1;
  });
}

/// Up to four balls in the field of all images and clear of their neighbours, far from each other; the first
/// is the middle one.
std::vector<CheckBox> boxes_of_balls(const phantom::Calibrator& calibrator, const Sweep& sweep,
                                     const Cameras& own) {
  constexpr std::size_t most = 4;
  constexpr double least_side = 2;  // diameters
  std::vector<CheckBox> free, chosen;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    middle += calibrator.balls[k].centre_in_calibrator / double(calibrator.balls.size());
    CheckBox box = box_of_ball(calibrator, k, *sweep.path->axis);
    if (2 * box.half().x() >= least_side * *box.diameter_mm &&
        std::ranges::all_of(
            own, [&](const View& view) { return is_inside(box, view, sweep.detector.image_size); }))
      free.push_back(std::move(box));
  }
  const auto place = [](const CheckBox& box) { return box.world_from_box.translation; };
  while (!free.empty() && chosen.size() < most) {
    const auto far = [&](const CheckBox& box) {
      if (chosen.empty()) return -(place(box) - middle).norm();
      double nearest = 1e9;
      for (const CheckBox& other : chosen) nearest = std::min(nearest, (place(box) - place(other)).norm());
      return nearest;
    };
    const auto next = std::ranges::max_element(free, {}, far);
    chosen.push_back(*next);
    free.erase(next);
  }
  return chosen;
}

/// The filter runs along rows, so rows are made to lie across the axis, and columns not mirrored.
struct Upright {
  bool transposed = false;

  View operator()(View view) const {
    geometry::Intrinsics& k = view.intrinsics;
    geometry::RigidTransform& pose = view.camera_from_world;
    if (transposed) {
      std::swap(k.fx, k.fy);
      std::swap(k.u0, k.v0);
      pose.rotation.row(0).swap(pose.rotation.row(1));
      std::swap(pose.translation.x(), pose.translation.y());
    }
    for (const Eigen::Index row : {0, 1})
      if (double& f = row == 0 ? k.fx : k.fy; f < 0) {
        f = -f;
        pose.rotation.row(row) *= -1;
        pose.translation[row] *= -1;
      }
    return view;
  }
  image::Image<float> operator()(image::Image<float> image) const {
    if (!transposed) return image;
    image::Image<float> turned(image.height(), image.width());
    for (int v = 0; v < turned.height(); ++v)
      for (int u = 0; u < turned.width(); ++u) turned(u, v) = image(v, u);
    return turned;
  }
};

Upright upright_of(const Sweep& sweep, const Cameras& own) {
  const View& view = own[own.size() / 2];
  const Eigen::Vector3d& middle = sweep.path->isocentre;
  const Eigen::Vector2d along = view.project(middle + *sweep.path->axis) - view.project(middle);
  return {std::abs(along.x()) > std::abs(along.y())};
}

/// The box where the target appears with other cameras, by their rays through its images: a circle about
/// another centre, or another world, displaces it as a whole.
CheckBox as_seen_by(const Cameras& cameras, CheckBox box, const Cameras& own) {
  std::vector<geometry::Projection> projections;
  std::vector<Eigen::Vector2d> pixels;
  for (std::size_t i = 0; i < own.size(); ++i) {
    projections.push_back(cameras[i].projection());
    pixels.push_back(own[i].project(box.world_from_box.translation));
  }
  box.world_from_box.translation = value_or_throw(geometry::intersect_linear(projections, pixels));
  return box;
}

/// Rows of the images that hold a target in every geometry: of each image the first, and their number.
struct Rows {
  std::vector<int> first;
  int count = 0;
};

/// `boxes`: of the target, in each geometry.
Rows rows_of(const std::vector<CheckBox>& boxes, const Geometries& all, const Upright& upright, int height) {
  constexpr int margin = 4;
  std::vector<std::pair<double, double>> spans;
  for (std::size_t i = 0; i < all.frames.size(); ++i) {
    double lowest = height, highest = 0;
    for (std::size_t g = 0; g < boxes.size(); ++g)
      for (const Eigen::Vector3d& corner : corners_of(boxes[g])) {
        const double v = upright(all.cameras[g][i]).project(corner).y();
        lowest = std::min(lowest, v), highest = std::max(highest, v);
      }
    spans.emplace_back(std::max(0.0, lowest), std::min<double>(height - 1, highest));
  }
  Rows rows;
  for (const auto& [lowest, highest] : spans)
    rows.count = std::max(rows.count, int(highest - lowest) + 2 * margin);
  rows.count = std::min(rows.count, height);
  for (const auto& [lowest, highest] : spans)
    rows.first.push_back(std::clamp(int((lowest + highest - rows.count) / 2), 0, height - rows.count));
  return rows;
}

std::string frame_name(std::size_t i, const char* ending) { return fmt::format("img_{:04d}.{}", i, ending); }

void write_bytes(const fs::path& file, std::string_view head, std::string_view body) {
  std::ofstream stream(file, std::ios::binary);
  stream << head << body;
  stream.close();
  if (!stream) throw BadInput(Reason::cannot_write, fmt::format("{}: cannot be written", file.string()));
}

/// PFM as plastimatch reads it: the first row first.
void write_rows(const fs::path& file, const image::Image<float>& image, int first, int count) {
  const auto bytes = std::size_t(count) * std::size_t(image.width()) * sizeof(float);
  write_bytes(file, fmt::format("Pf\n{} {}\n-1\n", image.width(), count),
              {reinterpret_cast<const char*>(image.row(first)), bytes});
}

/// Line integrals of the attenuation, up to a factor and a constant.
image::Image<float> attenuation_of(const xray::XrayImage& xray_image) {
  constexpr double open_share = 0.995;
  constexpr float least = 1e-3f;  // of the open beam
  image::Image<float> image = xray_image.pixels;
  const auto pixels = image.pixels();
  if (xray_image.acquisition.logarithmic.value_or(false)) {
    for (float& value : pixels) value = xray_image.highest - value;
    return image;
  }
  std::vector<float> ranked(pixels.begin(), pixels.end());
  const auto rank = ranked.begin() + std::ptrdiff_t(open_share * double(ranked.size()));
  std::ranges::nth_element(ranked, rank);
  const float open = std::max(1e-6f, *rank - xray_image.lowest);
  for (float& value : pixels) value = -std::log(std::max(least, (value - xray_image.lowest) / open));
  return image;
}

/// Each target's rows of each image, in its folder.
void write_images(const SweepCase& the_case, const Geometries& all, const Upright& upright,
                  const std::vector<Rows>& rows, const fs::path& folder, unsigned threads,
                  const std::function<void()>& done) {
  std::mutex guard;
  parallel_for(all.frames.size(), threads, [&](std::size_t i) {
    const Frame& frame = the_case.frames[all.frames[i]];
    const image::Image<float> image =
        upright(attenuation_of(value_or_throw(rectified_image_of(frame, the_case))));
    for (std::size_t t = 0; t < rows.size(); ++t)
      write_rows(folder / std::to_string(t) / frame_name(i, "pfm"), image, rows[t].first[i], rows[t].count);
    const std::lock_guard lock(guard);
    done();
  });
}

CheckedImage reconstructed(const CheckBox& box, const Rows& rows, const Cameras& cameras,
                           const Upright& upright, double pixel_mm, const std::string& program,
                           const fs::path& images) {
  const TemporaryFolder folder;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    View view = upright(cameras[i]);
    view.camera_from_world = view.camera_from_world * box.world_from_box;
    view.intrinsics.v0 -= rows.first[i];
    write_bytes(folder.path() / frame_name(i, "txt"), exchange::plastimatch_matrix(view, pixel_mm), "");
    fs::create_symlink(images / frame_name(i, "pfm"), folder.path() / frame_name(i, "pfm"));
  }
  const Reconstruction volume = value_or_throw(reconstruct(program, folder.path(), box.size, box.voxel_mm));
  return {box.diameter_mm ? ball_width_mm(volume, *box.diameter_mm) : wire_width_mm(volume),
          middle_slice(volume), 2 * box.half().x()};
}

void check_possible(const Sweep& sweep) {
  constexpr double least_arc_deg = 180;
  if (sweep.failure || !sweep.path) throw BadInput(Reason::too_few_views, "the run is refused");
  if (!sweep.path->axis || sweep.path->arc_deg < least_arc_deg)
    throw BadInput(
        Reason::too_few_views,
        fmt::format("the run turns by {:.0f} degrees, at least {:g} are needed to reconstruct from it",
                    sweep.path->axis ? sweep.path->arc_deg : 0.0, least_arc_deg));
}

std::optional<double> median_ratio(const std::vector<CheckedTarget>& targets, const auto& other) {
  std::vector<double> ratios;
  for (const CheckedTarget& target : targets) {
    const std::optional<double> width = other(target);
    if (width && target.own.width_mm) ratios.push_back(*width / *target.own.width_mm);
  }
  if (ratios.empty()) return {};
  return median(std::move(ratios));
}

ReconstructionCheck checked(const SweepCase& the_case, const Sweep& sweep, const CheckOptions& options,
                            const std::function<void(double)>& progress) {
  ReconstructionCheck check;
  check.program = value_or_throw(version_of(options.program));
  check_possible(sweep);
  const Geometries all = geometries_of(sweep, options);
  check.images = int(all.frames.size());
  std::vector<CheckBox> boxes = boxes_of_balls(the_case.base.calibrator, sweep, all.cameras.front());
  const std::optional<Wire> wire = options.wire ? options.wire : wire_of(the_case.base.calibrator);
  if (wire) boxes.push_back(box_of_wire(*wire));
  if (boxes.empty())
    throw BadInput(Reason::too_few_fiducials,
                   "no ball is in the field of all images and clear of the others");
  const Upright upright = upright_of(sweep, all.cameras.front());
  const auto& size = sweep.detector.image_size;
  const TemporaryFolder folder;
  std::vector<Rows> rows;
  std::vector<std::vector<CheckBox>> of_geometries;
  for (std::size_t t = 0; t < boxes.size(); ++t) {
    auto& seen = of_geometries.emplace_back(std::vector{boxes[t]});
    for (std::size_t g = 1; g < all.cameras.size(); ++g)
      seen.push_back(as_seen_by(all.cameras[g], boxes[t], all.cameras.front()));
    rows.push_back(rows_of(seen, all, upright, upright.transposed ? size.x() : size.y()));
    fs::create_directory(folder.path() / std::to_string(t));
  }
  const std::size_t each = all.cameras.size(), jobs = boxes.size() * each;
  std::size_t done = 0;
  const auto tell = [&] {
    ++done;
    if (progress) progress(double(done) / double(all.frames.size() + jobs));
  };
  write_images(the_case, all, upright, rows, folder.path(), options.threads, tell);
  std::vector<CheckedImage> images(jobs);
  std::mutex guard;
  parallel_for(jobs, options.threads, [&](std::size_t job) {
    const std::size_t t = job / each;
    images[job] = reconstructed(of_geometries[t][job % each], rows[t], all.cameras[job % each], upright,
                                sweep.detector.pixel_mm, options.program, folder.path() / std::to_string(t));
    const std::lock_guard lock(guard);
    tell();
  });
  for (std::size_t t = 0; t < boxes.size(); ++t) {
    auto* of = &images[t * each];
    check.targets.push_back({boxes[t].name, boxes[t].diameter_mm, std::move(of[0]), std::move(of[1]),
                             each > 2 ? std::optional(std::move(of[2])) : std::nullopt});
  }
  return check;
}

}  // namespace

std::optional<double> ReconstructionCheck::circle_ratio() const {
  return median_ratio(targets, [](const CheckedTarget& target) { return target.circle.width_mm; });
}

std::optional<double> ReconstructionCheck::other_ratio() const {
  return median_ratio(targets, [](const CheckedTarget& target) {
    return target.other ? target.other->width_mm : std::nullopt;
  });
}

Expected<Wire> wire_from(const std::string& text) {
  std::array<double, 6> at{};
  char extra = 0;
  if (std::sscanf(text.c_str(), "%lf,%lf,%lf;%lf,%lf,%lf%c", &at[0], &at[1], &at[2], &at[3], &at[4], &at[5],
                  &extra) != 6)
    return fail(Reason::bad_value,
                fmt::format("wire: \"{}\" is not x,y,z;x,y,z: its two ends in mm, calibrator frame", text));
  const Wire wire{{at[0], at[1], at[2]}, {at[3], at[4], at[5]}};
  constexpr double least_mm = 5, most_mm = 1000;
  const double length = (wire.to - wire.from).norm();
  if (!(length >= least_mm && wire.from.norm() <= most_mm && wire.to.norm() <= most_mm))
    return fail(Reason::bad_value,
                fmt::format("wire: {} mm long, must be at least {:g}, within {:g} mm of the origin", length,
                            least_mm, most_mm));
  return wire;
}

Expected<ReconstructionCheck> check_reconstruction(const SweepCase& the_case, const Sweep& sweep,
                                                   const CheckOptions& options,
                                                   const std::function<void(double)>& progress) {
  return guarded([&] { return checked(the_case, sweep, options, progress); });
}

Expected<void> add_check(Sweep& sweep, const SweepCase& the_case, const CheckOptions& options,
                         const std::function<void(double share)>& progress) {
  constexpr std::array left_out{Reason::missing_file, Reason::unsupported, Reason::too_few_views,
                                Reason::too_few_fiducials};
  if (sweep.failure) return {};
  auto check = check_reconstruction(the_case, sweep, options, progress);
  if (check) {
    sweep.check = *std::move(check);
    return {};
  }
  Failure why = std::move(check.error());
  if (std::ranges::find(left_out, why.reason) == left_out.end()) return tl::unexpected(std::move(why));
  why.message = "the check by reconstruction is left out: " + why.message;
  if (why.reason == Reason::missing_file) why.message += "; Debian's package plastimatch holds it";
  sweep.warnings.push_back(std::move(why));
  return {};
}

}  // namespace helicarm::sweep

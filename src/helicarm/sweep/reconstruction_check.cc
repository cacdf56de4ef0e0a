// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/reconstruction_check.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <mutex>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/core/statistics.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/exchange/run_geometry.h"
#include "helicarm/sweep/check_boxes.h"
#include "helicarm/sweep/check_images.h"
#include "helicarm/sweep/path.h"
#include "helicarm/sweep/reconstruction.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {
namespace {

using geometry::View;
namespace fs = std::filesystem;

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
    rows.push_back(rows_of(seen, all.cameras, upright, upright.transposed ? size.x() : size.y()));
    fs::create_directory(folder.path() / std::to_string(t));
  }
  const std::size_t each = all.cameras.size(), jobs = boxes.size() * each;
  std::size_t done = 0;
  const auto tell = [&] {
    ++done;
    if (progress) progress(double(done) / double(all.frames.size() + jobs));
  };
  write_images(the_case, all.frames, upright, rows, folder.path(), options.threads, tell);
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

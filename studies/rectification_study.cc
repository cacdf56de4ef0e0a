// SPDX-License-Identifier: Apache-2.0
#include "studies/rectification_study.h"

#include <algorithm>
#include <bit>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/random.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/rectification/test_grid.h"
#include "helicarm/simulation/simulate_case.h"
#include "studies/paper_scene.h"
#include "studies/records.h"

namespace helicarm::study {
namespace {

constexpr double no_figure = std::numeric_limits<double>::quiet_NaN();
template <class Record>
Record all_missing() {
  NumbersOf<Record> missing;
  missing.fill(no_figure);
  return std::bit_cast<Record>(missing);
}

std::uint32_t seed_of_intensifier(const RectificationStudyOptions& options, std::size_t number) {
  return RandomStream(options.seed, rectification_stream, number).bits();
}

struct Maps {
  rectification::DistortionMap paper, best;
};

/// Crosses within both maps, so that all errors are of the same ones.
std::vector<detection::Dot> within_both(std::vector<detection::Dot> crosses, const Maps& maps) {
  std::erase_if(crosses, [&](const detection::Dot& cross) {
    return !maps.paper.rectified_from_raw(cross.centre_px) || !maps.best.rectified_from_raw(cross.centre_px);
  });
  return crosses;
}

struct Measured {
  rectification::TestGrid paper, best;
  GridErrors errors() const {
    return {paper.raw.mean_px,      paper.raw.max_px,       paper.rectified.mean_px,
            paper.rectified.max_px, best.rectified.mean_px, best.rectified.max_px};
  }
};

std::optional<Measured> measured_by(const std::vector<detection::Dot>& crosses, const Maps& maps,
                                    rectification::GridFit fit) {
  auto paper = rectification::measure_test_grid(crosses, maps.paper, fit);
  auto best = rectification::measure_test_grid(crosses, maps.best, fit);
  if (!paper || !best) return {};
  return Measured{*std::move(paper), *std::move(best)};
}

/// Index of the true cross at this position; a mesh is 80 px wide, 40 px for images of 512 px.
std::optional<std::size_t> true_cross(const simulation::SimulatedView& view, const Eigen::Vector2d& raw) {
  constexpr double same_px = 5;
  for (std::size_t i = 0; i < view.crosses.size(); ++i)
    if ((view.crosses[i].raw - raw).norm() < same_px) return i;
  return {};
}

/// Results that depend on a refused map or grid stay NaN.
GridImage measure_image(const simulation::SimulatedView& view, const std::optional<Maps>& maps,
                        std::span<GridCross> kept) {
  GridImage image = all_missing<GridImage>();
  image.crosses = 0;
  if (!maps) return image;
  const auto crosses = within_both(rectification::find_grid(exposure_of(view)), *maps);
  double squares = 0;
  for (const detection::Dot& cross : crosses)
    if (const auto at = true_cross(view, cross.centre_px))
      squares += (view.crosses[*at].raw - cross.centre_px).squaredNorm(), ++image.crosses;
  if (image.crosses > 0) image.finder_rms = std::sqrt(squares / image.crosses);
  if (const auto all = measured_by(crosses, *maps, rectification::GridFit::all)) image.all = all->errors();
  const auto nine = measured_by(crosses, *maps, rectification::GridFit::nine);
  if (!nine) return image;
  image.nine = nine->errors();
  const rectification::TestGrid& paper = nine->paper;
  for (std::size_t k = 0; k < paper.raw_px.size() && !kept.empty(); ++k)
    if (const auto at = true_cross(view, paper.raw_px[k]))
      kept[*at] = {paper.raw_px[k].x(),
                   paper.raw_px[k].y(),
                   paper.raw_ideal_px[k].x(),
                   paper.raw_ideal_px[k].y(),
                   paper.raw_error_px[k],
                   paper.rectified_error_px[k],
                   nine->best.rectified_error_px[k]};
  return image;
}

std::optional<Maps> maps_of(const simulation::SimulatedCase& given) {
  const xray::XrayImage plate = exposure_of(given.views.front());
  auto paper = rectification::rectify(plate, *given.plate, {rectification::Method::paper, {}});
  auto best = rectification::rectify(plate, *given.plate, {rectification::Method::best, {}});
  if (!paper || !best) return {};
  return Maps{std::move(paper->map), std::move(best->map)};
}

void run_intensifier(const RectificationStudyOptions& options, std::size_t number, std::span<double> out) {
  simulation::SimulationOptions simulated;
  simulated.seed = seed_of_intensifier(options, number);
  simulated.kind = simulation::CaseKind::grid;
  simulated.size = options.size_px;
  simulated.grid_distances_mm = options.distances_mm;
  simulated.threads = 1;
  const auto given = value_or_throw(simulation::simulate_case(simulated));
  const auto maps = maps_of(given);
  std::array<GridCross, crosses_of_grid> crosses;
  crosses.fill(all_missing<GridCross>());
  for (std::size_t i = 0; i < options.distances_mm.size(); ++i) {
    const bool keep = options.distances_mm[i] == options.figure_distance_mm;
    const auto image =
        measure_image(given.views[i + 1], maps, keep ? std::span(crosses) : std::span<GridCross>());
    put_record(image, out);
  }
  for (const GridCross& cross : crosses) put_record(cross, out);
}

}  // namespace

Expected<std::vector<Intensifier>> study_rectification(const RectificationStudyOptions& options,
                                                       const EngineOptions& engine, const Ranks& ranks) {
  if (options.groups < 1) return fail(Reason::bad_value, "groups: 0, at least 1 is required");
  if (std::ranges::count(options.distances_mm, options.figure_distance_mm) != 1)
    return fail(Reason::bad_value,
                fmt::format("distances: must contain {} mm, the figure's distance, exactly once",
                            options.figure_distance_mm));
  StudySetting setting;
  setting.blocks = options.groups;
  setting.values_per_block =
      options.distances_mm.size() * numbers_in<GridImage> + crosses_of_grid * numbers_in<GridCross>;
  setting.work = [&](std::size_t block, std::span<double> values) {
    run_intensifier(options, block, values);
  };
  const std::string identity = fmt::format(
      "rectification {} groups {} seed {} size {} distances {} figure {}", HELICARM_VERSION, options.groups,
      options.seed, options.size_px, fmt::join(options.distances_mm, ","), options.figure_distance_mm);
  return run_study({setting}, identity, engine, ranks).map([&](const auto& kept) {
    std::vector<Intensifier> intensifiers;
    if (kept.empty()) return intensifiers;
    std::span<const double> values = kept.front();
    for (std::size_t i = 0; i < options.groups; ++i) {
      Intensifier intensifier{seed_of_intensifier(options, i), {}, {}};
      for (std::size_t k = 0; k < options.distances_mm.size(); ++k)
        intensifier.images.push_back(take_record<GridImage>(values));
      for (GridCross& cross : intensifier.crosses) cross = take_record<GridCross>(values);
      intensifiers.push_back(std::move(intensifier));
    }
    return intensifiers;
  });
}

}  // namespace helicarm::study

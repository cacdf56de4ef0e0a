// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/stages.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/parallel.h"
#include "helicarm/pipeline/map_cache.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/rectification/intrinsics_prior.h"
#include "helicarm/rectification/usable.h"

namespace helicarm::pipeline {
namespace {

/// A stage's result for each view, or its failure.
template <class Work>
auto of_each(std::size_t count, const RunOptions& options, const Progress& progress, Work&& work) {
  using Given = std::invoke_result_t<Work, std::size_t>;
  std::vector<Given> given(count, Given(tl::unexpect, Failure{Reason::interrupted, {}}));
  parallel_for(count, options.threads, [&](std::size_t i) {
    if (progress.view) progress.view();
    given[i] = work(i);
  });
  return given;
}

/// Every view with the stage's result; if it failed for one, a refusal with all results.
template <class Next, class View, class Added>
OrRefusal<std::vector<Next>> joined(Stage stage, std::vector<View> views,
                                    std::vector<Expected<Added>> added) {
  std::vector<Next> next;
  const auto failed = std::ranges::find_if(added, [](const auto& one) { return !one; });
  if (failed != added.end()) {
    Refusal refusal{failed->error(), stage, {}};
    refusal.failure.view = views[std::size_t(failed - added.begin())].name;
    for (std::size_t i = 0; i < views.size(); ++i)
      refusal.views.push_back(added[i] ? reported(Next{std::move(views[i]), *std::move(added[i])})
                                       : reported(views[i]));
    return tl::unexpected(std::move(refusal));
  }
  for (std::size_t i = 0; i < views.size(); ++i) next.push_back({std::move(views[i]), *std::move(added[i])});
  return next;
}

Expected<rectification::DistortionMap> map_of(const xray::XrayImage& xray_image, const CaseView& from,
                                              const std::optional<phantom::Plate>& plate,
                                              const RunOptions& options) {
  if (from.map)
    return read_json(*from.map).and_then([&](const Json& json) {
      return rectification::distortion_map_from_json(json, from.map->filename().string());
    });
  if (from.plate_image) return plate_image_map(from, *plate, options.method, options.cache);
  return rectification::flat_panel_map(xray_image);
}

Expected<rectification::Rectification> rectify_view(const xray::XrayImage& xray_image, const CaseView& from,
                                                    const std::optional<phantom::Plate>& plate,
                                                    const RunOptions& options) {
  if (plate && !from.map && !from.plate_image)
    return rectification::rectify(xray_image, *plate, {options.method, {}});
  return map_of(xray_image, from, plate, options).and_then([&](const rectification::DistortionMap& map) {
    return rectification::with_map(xray_image, map, plate);
  });
}

/// Of a fiducial's image, with a margin; 0 where the pixel size or the fiducials' sizes are unknown.
double least_radius_px(const Case& given, const rectification::DistortionMap& map) {
  constexpr double margin = 0.9;
  if (!map.rectified_pixel_mm) return 0;
  if (!given.calibrator.balls.empty())
    return margin * fiducials::ball_radii_px(given.calibrator, *map.rectified_pixel_mm).low;
  if (given.diameters_mm.empty()) return 0;
  return margin * std::ranges::min(given.diameters_mm) / 2 / *map.rectified_pixel_mm;
}

bool is_ambiguous(const Expected<fiducials::LabelledFiducials>& labels) {
  return !labels && labels.error().reason == Reason::ambiguous_labels;
}

/// The plate's kind determines the polarity of metal: it is wrong if the opposite polarity gives labels.
bool is_plate_of_other_kind(const DetectedView& view, const Case& given,
                            const fiducials::FiducialOptions& options) {
  if (view.rectification.dots_found == 0) return false;
  rectification::Rectification inverted = view.rectification;
  inverted.metal = detection::opposite(inverted.metal);
  inverted.other_dots.reset();
  const auto labels = fiducials::label_fiducials(
      *view.xray_image, inverted,
      fiducials::detect_candidates(*view.xray_image, inverted, least_radius_px(given, inverted.map)),
      given.calibrator, options);
  return labels || is_ambiguous(labels);
}

/// Relative radius bias of the view whose labels have the largest margin; nothing if no view is labelled.
std::optional<double> common_radius_bias(const std::vector<Expected<fiducials::LabelledFiducials>>& views) {
  const fiducials::LabelledFiducials* surest = nullptr;
  for (const auto& view : views)
    if (view && (!surest || view->margin > surest->margin)) surest = &*view;
  return surest ? std::optional(surest->radius_bias) : std::nullopt;
}

}  // namespace

Expected<void> check_images_belong_together(const std::vector<ReadView>& views) {
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const xray::Acquisition& a = views[j].xray_image->acquisition;
      const xray::Acquisition& b = views[i].xray_image->acquisition;
      if (!a.patient_key.empty() && !b.patient_key.empty() && a.patient_key != b.patient_key)
        return fail(Reason::patient_mismatch, fmt::format("{} and {} are of different patients or studies",
                                                          views[j].name, views[i].name));
      if (!a.instance_key.empty() && a.instance_key == b.instance_key)
        return rectification::check_usable(*views[i].xray_image).and_then([&]() -> Expected<void> {
          return fail(Reason::views_too_close,
                      fmt::format("{} and {} are the same image", views[j].name, views[i].name));
        });
    }
  return {};
}

OrRefusal<std::vector<ReadView>> read_views(const Case& given, const RunOptions& options,
                                            const Progress& progress) {
  std::vector<NamedView> views;
  for (const CaseView& view : given.views) views.push_back({view.name});
  auto images = of_each(views.size(), options, progress, [&](std::size_t i) {
    return image_of(given.views[i]).map([](xray::XrayImage xray_image) {
      return std::make_shared<const xray::XrayImage>(std::move(xray_image));
    });
  });
  return joined<ReadView>(Stage::read, std::move(views), std::move(images))
      .and_then([](std::vector<ReadView> read) -> OrRefusal<std::vector<ReadView>> {
        const auto together = check_images_belong_together(read);
        if (together) return read;
        Refusal refusal{together.error(), Stage::read, {}};
        for (const ReadView& view : read) refusal.views.push_back(reported(view));
        return tl::unexpected(std::move(refusal));
      });
}

OrRefusal<std::vector<RectifiedView>> rectify_views(std::vector<ReadView> views, const Case& given,
                                                    const RunOptions& options, const Progress& progress) {
  auto rectified = of_each(views.size(), options, progress, [&](std::size_t i) {
    return rectify_view(*views[i].xray_image, given.views[i], given.plate, options);
  });
  return joined<RectifiedView>(Stage::rectify, std::move(views), std::move(rectified));
}

OrRefusal<std::vector<DetectedView>> detect_in_views(std::vector<RectifiedView> views, const Case& given,
                                                     const RunOptions& options, const Progress& progress) {
  auto candidates =
      of_each(views.size(), options, progress, [&](std::size_t i) -> Expected<fiducials::Candidates> {
        return fiducials::detect_candidates(*views[i].xray_image, views[i].rectification,
                                            least_radius_px(given, views[i].rectification.map));
      });
  return joined<DetectedView>(Stage::label, std::move(views), std::move(candidates));
}

OrRefusal<std::vector<DetectedView>> detected_views(const Case& given, const RunOptions& options,
                                                    const Progress& progress) {
  const auto stage = [&](std::string_view name, auto work) {
    return [&, name, work](auto views) {
      progress.begin(name);
      return work(std::move(views), given, options, progress);
    };
  };
  progress.begin("read");
  return read_views(given, options, progress)
      .and_then(stage("rectify", rectify_views))
      .and_then(stage("detect", detect_in_views));
}

calibration::ViewFiducials fiducials_of(const LabelledView& view) {
  const rectification::DistortionMap& map = view.rectification.map;
  std::vector<Eigen::Vector2d> used;
  for (const fiducials::Fiducial& ball : view.fiducials.fiducials)
    if (ball.status == fiducials::FiducialStatus::used) used.push_back(ball.uv);
  return {view.name, view.fiducials.fiducials, rectification::intrinsics_prior(*view.xray_image, map),
          view.fiducials.view, map.covariance_px2(used)};
}

OrRefusal<std::vector<LabelledView>> label_views(std::vector<DetectedView> views, const Case& given,
                                                 const RunOptions& options, const Progress& progress) {
  const auto label = [&](std::size_t i, std::optional<double> radius_bias) {
    const fiducials::FiducialOptions how{options.method, radius_bias, given.views[i].mirrored};
    auto labels = fiducials::label_fiducials(*views[i].xray_image, views[i].rectification,
                                             views[i].candidates, given.calibrator, how);
    if (!labels && !is_ambiguous(labels) && is_plate_of_other_kind(views[i], given, how))
      labels = fail(Reason::plate_mismatch,
                    "the calibrator is found with the opposite polarity of metal: exchange \"holes\" and "
                    "\"balls\" in the "
                    "plate's file");
    return labels;
  };
  auto labels = of_each(views.size(), options, progress, [&](std::size_t i) { return label(i, {}); });
  if (const auto radius_bias = common_radius_bias(labels))
    labels = of_each(views.size(), options, progress, [&](std::size_t i) {
      return is_ambiguous(labels[i]) ? label(i, radius_bias) : std::move(labels[i]);
    });
  const bool contradict_plate = std::ranges::any_of(labels, [](const auto& of_view) {
    return !of_view && of_view.error().reason == Reason::plate_mismatch;
  });
  return joined<LabelledView>(contradict_plate ? Stage::rectify : Stage::label, std::move(views),
                              std::move(labels));
}

}  // namespace helicarm::pipeline

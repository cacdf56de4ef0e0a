// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/stages.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/core/files.h"
#include "helicarm/core/parallel.h"
#include "helicarm/detection/find_dots.h"
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
  std::vector<Given> results(count, Given(tl::unexpect, Failure{Reason::interrupted, {}}));
  parallel_for(count, options.threads, [&](std::size_t i) {
    if (progress.view) progress.view();
    results[i] = work(i);
  });
  return results;
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

void check_size(const xray::XrayImage& xray_image, const rectification::DistortionMap& recorded) {
  const image::Image<float>& pixels = xray_image.pixels;
  if (pixels.width() != recorded.width || pixels.height() != recorded.height)
    throw BadInput(
        Reason::plate_mismatch,
        fmt::format(
            "the image has {} x {} pixels, and the C-arm's record (--machine) holds distortion maps of "
            "{} x {}: record a case with a plate in this mode, or name plate_image or map",
            pixels.width(), pixels.height(), recorded.width, recorded.height));
}

struct KnownMap {
  rectification::DistortionMap map;
  rectification::MapSource source;
};

Expected<KnownMap> map_of(const xray::XrayImage& xray_image, const CaseView& from,
                          const std::optional<phantom::Plate>& plate, const RunOptions& options) {
  using rectification::MapSource;
  return guarded([&]() -> KnownMap {
    if (from.map)
      return {value_or_throw(rectification::distortion_map_from_json(value_or_throw(read_json(*from.map)),
                                                                     from.map->filename().string())),
              MapSource::file};
    if (from.plate_image)
      return {value_or_throw(plate_image_map(from, *plate, options.method, options.cache)),
              MapSource::plate_image};
    const xray::Acquisition& acquisition = xray_image.acquisition;
    if (options.maps) check_size(xray_image, options.maps->entries.back().plate->map);
    if (options.maps)
      return {map_at(*options.maps, acquisition.primary_angle_deg, acquisition.secondary_angle_deg),
              MapSource::record};
    return {rectification::flat_panel_map(xray_image), MapSource::none};
  });
}

/// Whether the map comes from the plate in the image itself.
bool shows_plate(const CaseView& view, const std::optional<phantom::Plate>& plate) {
  return plate && !view.map && !view.plate_image;
}

Warning far_from_record(const rectification::DistortionMap& map, bool states_angles) {
  const double expected_px = map.held_out_rms_px / std::sqrt(2.0);
  return {Reason::residual_distortion,
          fmt::format(
              "{}, so the map by the C-arm's record is little more than the mean of its maps: {:.2f} px per "
              "axis off, as its covariance says; {}",
              states_angles ? "no recorded position is near that of the image"
                            : "the image does not state the positioner's angles",
              expected_px,
              states_angles ? "record a case with the plate near it" : "state them beside the image"),
          {},
          {{"expected_px", expected_px}}};
}

bool has_no_map(const CaseView& view, const std::optional<phantom::Plate>& plate) {
  return !plate && !view.map && !view.plate_image;
}

std::shared_ptr<const calibration::CArmMaps> maps_of_record(const RunOptions& options) {
  if (!options.history) return nullptr;
  auto maps = calibration::c_arm_maps(options.history->entries);
  return maps ? std::make_shared<const calibration::CArmMaps>(*std::move(maps)) : nullptr;
}

Expected<rectification::Rectification> rectify_view(DetectedView& view, const CaseView& from,
                                                    const std::optional<phantom::Plate>& plate,
                                                    const RunOptions& options) {
  const xray::XrayImage& xray_image = *view.xray_image;
  auto source = rectification::MapSource::plate;
  auto rectified = shows_plate(from, plate)
                       ? rectification::rectify(xray_image, view.dots, *plate, {options.method, {}})
                       : map_of(xray_image, from, plate, options).and_then([&](const KnownMap& known) {
                           source = known.source;
                           return rectification::with_map(xray_image, view.dots, known.map, plate);
                         });
  if (rectified) rectified->source = source;
  if (rectified && source == rectification::MapSource::record) {
    const xray::Acquisition& acquisition = xray_image.acquisition;
    if (is_far_from_maps(*options.maps, acquisition.primary_angle_deg, acquisition.secondary_angle_deg))
      rectified->warnings.push_back(
          far_from_record(rectified->map, acquisition.primary_angle_deg.has_value()));
  }
  if (rectified) detection::dots_of(view.dots, xray_image, rectified->metal);
  return rectified;
}

/// Of a fiducial's image, with a margin; 0 where the pixel size or the fiducials' sizes are unknown.
double least_fiducial_px(const xray::XrayImage& xray_image, const Case& the_case) {
  constexpr double margin = 0.9;
  const auto& pixel = xray_image.acquisition.pixel_mm;
  if (!pixel) return 0;
  const double pixel_mm = std::sqrt(pixel->x() * pixel->y());
  if (!the_case.calibrator.balls.empty())
    return margin * fiducials::ball_radii_px(the_case.calibrator, pixel_mm).low;
  if (the_case.diameters_mm.empty()) return 0;
  return margin * std::ranges::min(the_case.diameters_mm) / 2 / pixel_mm;
}

/// The dots that the rectification and the labelling choose from.
detection::ImageDots detect_in_view(const xray::XrayImage& xray_image, const CaseView& from,
                                    const Case& the_case) {
  const bool plated = shows_plate(from, the_case.plate);
  const double of_plate = plated ? rectification::least_dot_radius_px(xray_image, *the_case.plate)
                                 : rectification::least_checked_radius_px(xray_image, the_case.plate);
  const double of_fiducials =
      std::max(detection::DotOptions{}.min_radius_px, least_fiducial_px(xray_image, the_case));
  detection::ImageDots dots = detection::unsearched(xray_image, std::min(of_plate, of_fiducials));
  detection::dots_of(dots, xray_image, detection::Polarity::dark);
  if (plated && the_case.plate->kind == phantom::DotKind::holes)
    detection::dots_of(dots, xray_image, detection::Polarity::bright);
  return dots;
}

bool is_ambiguous(const Expected<fiducials::LabelledFiducials>& labels) {
  return !labels && labels.error().reason == Reason::ambiguous_labels;
}

/// The plate's kind determines the polarity of metal: it is wrong if the opposite polarity gives labels.
bool is_plate_of_other_kind(RectifiedView view, const Case& the_case,
                            const fiducials::FiducialOptions& options) {
  if (view.rectification.dots_found == 0) return false;
  detection::Polarity& metal = view.rectification.metal;
  metal = detection::opposite(metal);
  detection::dots_of(view.dots, *view.xray_image, metal);
  const auto labels = fiducials::label_fiducials(*view.xray_image, view.dots, view.rectification,
                                                 the_case.calibrator, options);
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

OrRefusal<std::vector<ReadView>> read_views(const Case& the_case, const RunOptions& options,
                                            const Progress& progress) {
  std::vector<NamedView> views;
  for (const CaseView& view : the_case.views) views.push_back({view.name});
  auto images = of_each(views.size(), options, progress, [&](std::size_t i) {
    return image_of(the_case.views[i]).map([](xray::XrayImage xray_image) {
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

OrRefusal<std::vector<DetectedView>> detect_in_views(std::vector<ReadView> views, const Case& the_case,
                                                     const RunOptions& options, const Progress& progress) {
  auto dots = of_each(views.size(), options, progress, [&](std::size_t i) -> Expected<detection::ImageDots> {
    return rectification::check_usable(*views[i].xray_image).map([&] {
      return detect_in_view(*views[i].xray_image, the_case.views[i], the_case);
    });
  });
  return joined<DetectedView>(Stage::rectify, std::move(views), std::move(dots));
}

OrRefusal<std::vector<RectifiedView>> rectify_views(std::vector<DetectedView> views, const Case& the_case,
                                                    const RunOptions& options, const Progress& progress) {
  RunOptions with_maps = options;
  if (!options.maps && std::ranges::any_of(the_case.views, [&](const CaseView& view) {
        return has_no_map(view, the_case.plate);
      }))
    with_maps.maps = maps_of_record(options);
  auto rectified = of_each(views.size(), options, progress, [&](std::size_t i) {
    return rectify_view(views[i], the_case.views[i], the_case.plate, with_maps);
  });
  return joined<RectifiedView>(Stage::rectify, std::move(views), std::move(rectified));
}

OrRefusal<std::vector<RectifiedView>> rectified_views(const Case& the_case, const RunOptions& options,
                                                      const Progress& progress) {
  const auto stage = [&](std::string_view name, auto work) {
    return [&, name, work](auto views) {
      progress.begin(name);
      return work(std::move(views), the_case, options, progress);
    };
  };
  progress.begin("read");
  return read_views(the_case, options, progress)
      .and_then(stage("detect", detect_in_views))
      .and_then(stage("rectify", rectify_views));
}

calibration::ViewFiducials fiducials_of(const LabelledView& view) {
  const rectification::DistortionMap& map = view.rectification.map;
  std::vector<Eigen::Vector2d> used;
  for (const fiducials::Fiducial& ball : view.fiducials.fiducials)
    if (ball.status == fiducials::FiducialStatus::used) used.push_back(ball.uv);
  return {view.name, view.fiducials.fiducials, rectification::intrinsics_prior(*view.xray_image, map),
          view.fiducials.view, map.covariance_px2(used)};
}

OrRefusal<std::vector<LabelledView>> label_views(std::vector<RectifiedView> views, const Case& the_case,
                                                 const RunOptions& options, const Progress& progress) {
  const auto label = [&](std::size_t i, std::optional<double> radius_bias) {
    const fiducials::FiducialOptions fiducial_options{options.method, radius_bias,
                                                      the_case.views[i].mirrored};
    auto labels = fiducials::label_fiducials(*views[i].xray_image, views[i].dots, views[i].rectification,
                                             the_case.calibrator, fiducial_options);
    if (!labels && !is_ambiguous(labels) && is_plate_of_other_kind(views[i], the_case, fiducial_options))
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

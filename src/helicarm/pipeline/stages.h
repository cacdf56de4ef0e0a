// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/progress.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// A view after each stage, with the results of the stages before it.
struct NamedView {
  std::string name;
};
struct ReadView : NamedView {
  std::shared_ptr<const xray::XrayImage> xray_image;
};
struct DetectedView : ReadView {
  detection::ImageDots dots;
};
struct RectifiedView : DetectedView {
  rectification::Rectification rectification;
};
struct LabelledView : RectifiedView {
  fiducials::LabelledFiducials fiducials;
};

/// As reported in a result: what its stage has reached.
template <std::derived_from<NamedView> View>
ViewResult reported(const View& view) {
  ViewResult result;
  result.name = view.name;
  if constexpr (std::derived_from<View, ReadView>) result.xray_image = view.xray_image;
  if constexpr (std::derived_from<View, DetectedView>) result.dots = view.dots;
  if constexpr (std::derived_from<View, RectifiedView>) result.rectification = view.rectification;
  if constexpr (std::derived_from<View, LabelledView>) result.found = view.fiducials;
  return result;
}

/// Reason of a refusal, and the results of all stages before it.
struct Refusal {
  Failure failure;
  Stage stage;  ///< whose result it concerns
  std::vector<ViewResult> views;
  Timing timing_ms = {};
};
template <class T>
using OrRefusal = tl::expected<T, Refusal>;

/// Reads the image files. Refuses `patient_mismatch` for images of different patients or studies, and
/// `views_too_close` for two copies of one image; fails as `read_xray_image`.
OrRefusal<std::vector<ReadView>> read_views(const Case& the_case, const RunOptions& options,
                                            const Progress& progress = {});

/// As `read_views` refuses.
Expected<void> check_images_belong_together(const std::vector<ReadView>& views);

/// 2.1: the dots of every image, of the plate and of metal.
OrRefusal<std::vector<DetectedView>> detect_in_views(std::vector<ReadView> views, const Case& the_case,
                                                     const RunOptions& options,
                                                     const Progress& progress = {});

/// 2.1, Eq. 1-3: by the plate among the dots, a separate plate image, a known map, or none (flat panel).
OrRefusal<std::vector<RectifiedView>> rectify_views(std::vector<DetectedView> views, const Case& the_case,
                                                    const RunOptions& options, const Progress& progress = {});

/// These three stages, announced by `progress`.
OrRefusal<std::vector<RectifiedView>> rectified_views(const Case& the_case, const RunOptions& options,
                                                      const Progress& progress = {});

/// The calibration's input from a labelled view.
calibration::ViewFiducials fiducials_of(const LabelledView& view);

/// 2.3.4. Ambiguous labels of a view are tried again with the radius bias of the view with the largest
/// margin.
OrRefusal<std::vector<LabelledView>> label_views(std::vector<RectifiedView> views, const Case& the_case,
                                                 const RunOptions& options, const Progress& progress = {});

}  // namespace helicarm::pipeline

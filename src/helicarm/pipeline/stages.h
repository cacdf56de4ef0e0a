// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/fiducials/label_fiducials.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// A view after each stage; every one holds what the stages before it gave.
struct NamedView {
  std::string name;
};
struct ReadView : NamedView {
  std::shared_ptr<const XrayImage> xray_image;
};
struct RectifiedView : ReadView {
  Rectification rectification;
};
struct DetectedView : RectifiedView {
  Candidates candidates;
};
struct LabelledView : DetectedView {
  LabelledFiducials fiducials;
};

/// As a result reports it.
ViewResult reported(const NamedView& view);
ViewResult reported(const ReadView& view);
ViewResult reported(const RectifiedView& view);
ViewResult reported(const LabelledView& view);

/// Why a case gives no answer, and all that the stages had computed until then.
struct Refusal {
  Failure failure;
  std::vector<ViewResult> views;
  Timing timing_ms = {};
};
template <class T>
using OrRefusal = tl::expected<T, Refusal>;

/// The images' files. Refuses `patient_mismatch` where two images name different patients or studies, and
/// `views_too_close` where two are one and the same image; fails as `read_xray_image`.
OrRefusal<std::vector<ReadView>> read_views(const Case& given, const RunOptions& options);

/// As `read_views` refuses.
Expected<void> check_images_belong_together(const std::vector<ReadView>& views);

/// 2.1, Eq. 1-3: by the plate in the image, by a plate image taken apart, by a known map, or not at all (flat
/// panel).
OrRefusal<std::vector<RectifiedView>> rectify_views(std::vector<ReadView> views, const Case& given,
                                                    const RunOptions& options);

/// 2.1: each image is searched once.
OrRefusal<std::vector<DetectedView>> detect_in_views(std::vector<RectifiedView> views, const Case& given,
                                                     const RunOptions& options);

/// What the calibration takes of a labelled view.
ViewFiducials fiducials_of(const LabelledView& view);

/// 2.3.4. Where one view alone leaves its labels ambiguous, the size of the balls in the surest other view
/// decides.
OrRefusal<std::vector<LabelledView>> label_views(std::vector<DetectedView> views, const Case& given,
                                                 const RunOptions& options);

}  // namespace helicarm

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/shown_images.h"

#include <opencv2/imgproc.hpp>

#include "helicarm/core/parallel.h"
#include "helicarm/image/opencv.h"
#include "helicarm/report/rectified_image.h"

namespace helicarm::phantom_calibration {

void add_images(const std::vector<pipeline::RectifiedView>& detected,
                const std::vector<std::size_t>& view_of_case, unsigned threads, PhantomResult& result) {
  constexpr int largest_width = 800;
  parallel_for(result.views.size(), threads, [&](std::size_t v) {
    image::Image<std::uint8_t> full = report::rectified_image(pipeline::reported(detected[view_of_case[v]]));
    MeasuredView& view = result.views[v];
    view.width = full.width();
    view.height = full.height();
    if (view.width <= largest_width) {
      view.shown = std::move(full);
      return;
    }
    view.shown = image::Image<std::uint8_t>((view.width + 1) / 2, (view.height + 1) / 2);
    cv::Mat half = image::as_mat(view.shown);
    cv::resize(image::as_mat(full), half, half.size(), 0, 0, cv::INTER_AREA);
  });
}

}  // namespace helicarm::phantom_calibration

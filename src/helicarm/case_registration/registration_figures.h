// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// DRR of a model at a pose for the report: displayed as an X-ray image, matter dark. It covers the whole
/// image of `image_size` (rectified px) at a reduced size. Empty unless the model is in front of the source.
image::Image<std::uint8_t> drr_image(const registration::Model& model, const geometry::View& view,
                                     const geometry::RigidTransform& world_from_model,
                                     const Eigen::Vector2i& image_size, unsigned threads);

/// The views' X-ray images at a reduced size, each once, for the figures to refer to.
std::string shared_images_html(const CaseRegistration& result);

/// A view's X-ray image with outlines and plan points of all models.
std::string overlay_figure(const CaseRegistration& result, std::size_t view);

/// A model over each view: DRR with a slider, and the agreement of each patch or contour point. Empty for a
/// registration by landmarks alone.
std::string model_figures(const CaseRegistration& result, std::size_t model);

/// Outlines of a refused model at its pose and at each alternative, over each view: to choose from. Empty
/// without alternatives.
std::string alternatives_html(const CaseRegistration& result, std::size_t model);

/// Script of the sliders; without it the figures show X-ray image and DRR half each.
std::string slider_script();

/// RGB of a model's outline, distinct for readers who do not see red and green apart.
const std::array<int, 3>& outline_colour(std::size_t model);

}  // namespace helicarm::case_registration

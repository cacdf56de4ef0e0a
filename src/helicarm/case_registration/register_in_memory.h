// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/case_registration/register_case.h"
#include "helicarm/exchange/import_matrix.h"

namespace helicarm::case_registration {

/// A model in memory, with where its registration starts.
struct GivenModel {
  registration::Model model;
  std::vector<geometry::RigidTransform> starts;  ///< world_from_model; none: it is searched anywhere
  std::optional<double> scale_sigma = {};        ///< relative, of the model's size
  std::vector<PlanPoint> points = {};            ///< planned, carried into the world
};

/// Views of images in memory that are free of distortion, with cameras of other programs. Fails as
/// `load_views`.
Expected<LoadedViews> views_of_images(std::vector<xray::XrayImage> images,
                                      const std::vector<exchange::ImportedMatrix>& cameras);

/// Registers models in memory to views. Without a start in one view: bad_value. Refusals are in the result.
Expected<CaseRegistration> register_given(std::vector<GivenModel> models, LoadedViews loaded,
                                          const RegisterOptions& options, const Progress& progress = {});

}  // namespace helicarm::case_registration

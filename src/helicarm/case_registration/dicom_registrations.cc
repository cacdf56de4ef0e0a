// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/dicom_registrations.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/report/earlier_results.h"
#include "helicarm/volume/read_volume.h"
#include "helicarm/xray/dicom_text.h"
#include "helicarm/xray/spatial_registration.h"
#include "helicarm/xray/uid.h"

namespace helicarm::case_registration {
namespace {

/// A long name is cut, not what is said of it.
std::string description_of(const std::string& model) {
  const std::string direction = " to calibrator";
  return xray::whole_characters(model, xray::long_string_bytes - direction.size()) + direction;
}

}  // namespace

std::string calibrator_frame_uid(const std::vector<geometry::View>& views) {
  std::string cameras = "frame of cameras";
  for (const geometry::View& view : views) {
    const Eigen::Matrix<double, 3, 4> projection = view.projection();
    for (const double value : projection.reshaped()) cameras += fmt::format(" {:.9g}", value);
  }
  return xray::uid_of(xray::text_key(cameras));
}

std::string calibrator_frame_uid(const CaseRegistration& result) {
  std::vector<geometry::View> views;
  for (const registration::RegistrationView& view : result.loaded.views) views.push_back(view.view);
  return calibrator_frame_uid(views);
}

Expected<std::optional<std::vector<std::filesystem::path>>> write_dicom_registrations(
    const pipeline::Case& the_case, const CaseRegistration& result, const std::filesystem::path& folder) {
  return guarded([&]() -> std::optional<std::vector<std::filesystem::path>> {
    std::vector<std::filesystem::path> files;
    bool is_any_series = false;
    for (std::size_t i = 0; i < std::min(result.models.size(), the_case.models.size()); ++i) {
      const auto& volume = the_case.models[i].volume;
      if (!volume) continue;
      const auto slice = value_or_throw(volume::slice_of_series(*volume));
      const auto frame = slice ? value_or_throw(xray::ct_frame_of(*slice)) : std::nullopt;
      is_any_series = is_any_series || frame.has_value();
      const registration::Registration& found = result.models[i].registration;
      if (!frame || found.failure) continue;
      xray::SpatialRegistration registration{
          *frame, calibrator_frame_uid(result), {}, description_of(found.name)};
      const Eigen::Matrix4d matrix = found.world_from_model.matrix();
      Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(registration.frame_from_ct.data()) = matrix;
      files.push_back(folder / (report::dicom_registration_name(found.name, i)));
      value_or_throw(xray::write_spatial_registration(files.back(), registration));
    }
    if (!is_any_series) return std::nullopt;
    return files;
  });
}

}  // namespace helicarm::case_registration

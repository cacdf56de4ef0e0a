// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/dicom_registrations.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/report/earlier_results.h"
#include "helicarm/xray/spatial_registration.h"
#include "helicarm/xray/uid.h"

namespace helicarm::case_registration {
namespace {

/// The same for the same cameras.
std::string frame_uid_of(const CaseRegistration& result) {
  std::string cameras = "frame of cameras";
  for (const registration::RegistrationView& view : result.loaded.views) {
    const Eigen::Matrix<double, 3, 4> projection = view.view.projection();
    for (const double value : projection.reshaped()) cameras += fmt::format(" {:.9g}", value);
  }
  return xray::uid_of(xray::text_key(cameras));
}

}  // namespace

Expected<std::vector<std::filesystem::path>> write_dicom_registrations(const pipeline::Case& the_case,
                                                                       const CaseRegistration& result,
                                                                       const std::filesystem::path& folder) {
  return guarded([&] {
    std::vector<std::filesystem::path> files;
    bool is_any_series = false;
    for (std::size_t i = 0; i < std::min(result.models.size(), the_case.models.size()); ++i) {
      const auto& volume = the_case.models[i].volume;
      if (!volume) continue;
      const auto frame = value_or_throw(xray::ct_frame_of(*volume));
      is_any_series = is_any_series || frame.has_value();
      const registration::Registration& found = result.models[i].registration;
      if (!frame || found.failure) continue;
      xray::SpatialRegistration registration{
          *frame, frame_uid_of(result), {}, fmt::format("{} to calibrator", found.name).substr(0, 64)};
      const Eigen::Matrix4d matrix = found.world_from_model.matrix();
      Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(registration.frame_from_ct.data()) = matrix;
      files.push_back(folder / (report::dicom_registration_name(found.name, i)));
      value_or_throw(xray::write_spatial_registration(files.back(), registration));
    }
    if (!is_any_series)
      throw BadInput(Reason::bad_value,
                     "models: no \"volume\" is a folder of a DICOM CT series that states its Frame of "
                     "Reference UID (0020,0052), which a DICOM registration needs");
    return files;
  });
}

}  // namespace helicarm::case_registration

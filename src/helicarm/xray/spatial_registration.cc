// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/spatial_registration.h"

#include <cmath>

#include <Eigen/LU>
#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/xray/dataset_writing.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/dicom_text.h"

namespace helicarm::xray {
namespace {

constexpr std::uintmax_t most_ct_slice_bytes = std::uintmax_t{64} << 20;

/// A DS has at most sixteen characters.
std::string decimals_of(const std::array<double, 16>& matrix) {
  return fmt::format("{:.9g}", fmt::join(matrix, "\\"));
}

void put_frame(DcmDataset& dataset, int at, const std::string& frame_uid,
               const std::array<double, 16>& matrix) {
  DcmItem& registered = item_in(dataset, DCM_RegistrationSequence, at);
  put_in(registered, DCM_FrameOfReferenceUID, frame_uid);
  DcmItem& step = item_in(registered, DCM_MatrixRegistrationSequence);
  step.insertEmptyElement(DCM_RegistrationTypeCodeSequence);
  DcmItem& transform = item_in(step, DCM_MatrixSequence);
  put_in(transform, DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
  put_in(transform, DCM_FrameOfReferenceTransformationMatrix, decimals_of(matrix));
}

void check_rigid(const SpatialRegistration& registration) {
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(registration.frame_from_ct.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool is_rigid = matrix.allFinite() && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1) &&
                        (rotation * rotation.transpose()).isIdentity(1e-6) && rotation.determinant() > 0;
  if (!is_rigid) throw BadInput(Reason::bad_value, "frame_from_ct: is not a rigid matrix");
}

void put_registration(DcmDataset& dataset, const SpatialRegistration& registration) {
  const std::string description =
      own_text(registration.ct.patient_study, whole_characters(registration.description));
  put_object(dataset, UID_SpatialRegistrationStorage, "REG",
             fmt::format("{} {} {} {}", registration.ct.patient_study.sop_instance_uid,
                         registration.frame_of_reference_uid, decimals_of(registration.frame_from_ct),
                         registration.description),
             registration.ct.patient_study);
  put_in(dataset, DCM_SeriesDescription, description);
  put_in(dataset, DCM_ContentLabel, "REGISTRATION");
  put_in(dataset, DCM_ContentDescription, description);
  put_in(dataset, DCM_FrameOfReferenceUID, registration.frame_of_reference_uid);
  for (const DcmTagKey& tag : {DCM_ContentCreatorName, DCM_PositionReferenceIndicator, DCM_Laterality})
    dataset.insertEmptyElement(tag);
  put_frame(dataset, 0, registration.ct.frame_of_reference_uid, registration.frame_from_ct);
  put_frame(dataset, 1, registration.frame_of_reference_uid,
            {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
}

}  // namespace

Expected<std::optional<CtFrame>> ct_frame_of(const std::filesystem::path& slice) {
  return guarded([&]() -> std::optional<CtFrame> {
    const std::string bytes = value_or_throw(read_file(slice, most_ct_slice_bytes));
    if (!looks_like_dicom(bytes)) return std::nullopt;
    const DicomElements elements = value_or_throw(walk_dicom(bytes, slice.string()));
    if (elements.text(tags::sop_class) != ct_class) return std::nullopt;
    CtFrame frame{std::string(elements.text(tags::frame_of_reference)), patient_study_in(elements)};
    if (frame.frame_of_reference_uid.empty()) return std::nullopt;
    return frame;
  });
}

Expected<void> write_spatial_registration(const std::filesystem::path& path,
                                          const SpatialRegistration& registration) {
  return guarded([&] {
    check_rigid(registration);
    DcmFileFormat file;
    put_registration(*file.getDataset(), registration);
    value_or_throw(save_private(path, file));
  });
}

}  // namespace helicarm::xray

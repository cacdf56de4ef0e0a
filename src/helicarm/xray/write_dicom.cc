// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/write_dicom.h"

#include <algorithm>
#include <memory>
#include <mutex>
#include <vector>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/xray/dicom_time.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace fs = std::filesystem;

namespace {

void prepare_dcmtk() {
  static std::once_flag once;
  std::call_once(once, [] {
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    DcmRLEEncoderRegistration::registerCodecs();
  });
}

void must(const OFCondition& status, const char* what) {
  if (status.bad()) throw BadInput(Reason::cannot_write, fmt::format("DICOM {}: {}", what, status.text()));
}

void put(DcmDataset& dataset, const DcmTagKey& tag, const std::string& value) {
  must(dataset.putAndInsertString(tag, value.c_str()), value.c_str());
}

void put(DcmDataset& dataset, const DcmTagKey& tag, int value) {
  must(dataset.putAndInsertUint16(tag, static_cast<Uint16>(value)), "number");
}

/// Ten digits: a DS holds at most sixteen characters.
std::string decimal(double value) { return fmt::format("{:.10g}", value); }

std::string decimal(std::optional<double> value) { return value ? decimal(*value) : std::string{}; }

void put_identity(DcmDataset& dataset, const DerivedImage& image) {
  const auto or_fresh = [](const std::string& uid) { return uid.empty() ? make_uid() : uid; };
  put(dataset, DCM_SpecificCharacterSet, "ISO_IR 192");
  put(dataset, DCM_ImageType,
      image.derived ? "DERIVED\\SECONDARY\\SINGLE PLANE" : "ORIGINAL\\PRIMARY\\SINGLE PLANE");
  put(dataset, DCM_SOPClassUID, UID_XRayAngiographicImageStorage);
  put(dataset, DCM_SOPInstanceUID, or_fresh(image.instance_uid));
  put(dataset, DCM_StudyInstanceUID, or_fresh(image.study_uid));
  put(dataset, DCM_SeriesInstanceUID, or_fresh(image.series_uid));
  put(dataset, DCM_Modality, "XA");
  put(dataset, DCM_Manufacturer, "helicarm");
  put(dataset, DCM_SoftwareVersions, HELICARM_VERSION);
  put(dataset, DCM_SeriesDescription, image.series_description);
  put(dataset, DCM_PatientName, image.patient_name);
  put(dataset, DCM_PatientID, image.patient_id);
  put(dataset, DCM_SeriesNumber, "1");
  put(dataset, DCM_InstanceNumber, "1");
  // Type 2: must be present, may be empty.
  for (const DcmTagKey& tag :
       {DCM_StudyDate, DCM_StudyTime, DCM_AccessionNumber, DCM_ReferringPhysicianName, DCM_PatientBirthDate,
        DCM_PatientSex, DCM_StudyID, DCM_PatientOrientation, DCM_KVP})
    put(dataset, tag, "");
  if (!image.derived) return;
  put(dataset, DCM_PatientIdentityRemoved, "YES");
  put(dataset, DCM_DeidentificationMethod, "Nothing of the source but geometry and pixels");
}

void put_acquisition(DcmDataset& dataset, const Acquisition& a) {
  put(dataset, DCM_RadiationSetting, "GR");
  if (a.pixel_mm)
    put(dataset, DCM_ImagerPixelSpacing,
        fmt::format("{}\\{}", decimal(a.pixel_mm->y()), decimal(a.pixel_mm->x())));
  if (a.source_detector_mm) put(dataset, DCM_DistanceSourceToDetector, decimal(*a.source_detector_mm));
  if (a.source_patient_mm) put(dataset, DCM_DistanceSourceToPatient, decimal(*a.source_patient_mm));
  put(dataset, DCM_PositionerPrimaryAngle, decimal(a.primary_angle_deg));
  put(dataset, DCM_PositionerSecondaryAngle, decimal(a.secondary_angle_deg));
  put(dataset, DCM_PositionerMotion, "STATIC");
  if (a.acquired) put(dataset, DCM_AcquisitionDateTime, dicom_date_time(a.acquired->seconds));
  if (a.flip_hint) put(dataset, DCM_FieldOfViewHorizontalFlip, "YES");
  put(dataset, DCM_PixelIntensityRelationship, !a.logarithmic ? "DISP" : *a.logarithmic ? "LOG" : "LIN");
  must(dataset.putAndInsertSint16(DCM_PixelIntensityRelationshipSign, 1), "sign");
}

void put_pixels(DcmDataset& dataset, const DerivedImage& image) {
  const int allocated = image.bits_stored > 8 ? 16 : 8;
  put(dataset, DCM_SamplesPerPixel, 1);
  put(dataset, DCM_PhotometricInterpretation, "MONOCHROME2");
  put(dataset, DCM_Rows, image.pixels.height());
  put(dataset, DCM_Columns, image.pixels.width());
  put(dataset, DCM_BitsAllocated, allocated);
  put(dataset, DCM_BitsStored, image.bits_stored);
  put(dataset, DCM_HighBit, image.bits_stored - 1);
  put(dataset, DCM_PixelRepresentation, 0);
  const auto pixels = image.pixels.pixels();
  if (allocated == 16) {
    must(dataset.putAndInsertUint16Array(DCM_PixelData, pixels.data(), pixels.size()), "pixels");
  } else {
    const std::vector<Uint8> bytes(pixels.begin(), pixels.end());
    must(dataset.putAndInsertUint8Array(DCM_PixelData, bytes.data(), bytes.size()), "pixels");
  }
}

void check(const fs::path& path, const DerivedImage& image) {
  const auto side = static_cast<int>(image::max_image_side);
  if (image.pixels.empty() || image.pixels.width() > side || image.pixels.height() > side)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} x {} pixels, must be 1 to {} a side", path.string(),
                                                 image.pixels.width(), image.pixels.height(), side));
  const int limit = (1 << image.bits_stored) - 1;
  const int greatest = *std::ranges::max_element(image.pixels.pixels());
  if (image.bits_stored < 8 || image.bits_stored > 16 || greatest > limit)
    throw BadInput(Reason::bad_value, fmt::format("{}: pixel value {} does not fit in {} bits (8 to 16)",
                                                  path.string(), greatest, image.bits_stored));
}

}  // namespace

Expected<void> write_dicom(const fs::path& path, const DerivedImage& image) {
  const E_TransferSyntax syntax = image.rle ? EXS_RLELossless : EXS_LittleEndianExplicit;
  const auto file = guarded([&] {
    check(path, image);
    prepare_dcmtk();
    auto made = std::make_unique<DcmFileFormat>();
    DcmDataset& dataset = *made->getDataset();
    put_identity(dataset, image);
    put_acquisition(dataset, image.acquisition);
    put_pixels(dataset, image);
    must(dataset.chooseRepresentation(syntax, nullptr), "compression");
    return made;
  });
  if (!file) return tl::unexpected<Failure>(file.error());
  return write_file_with(path, [&](const fs::path& aside) -> Expected<void> {
    const OFCondition status = (*file)->saveFile(aside.c_str(), syntax);
    if (status.bad()) return fail(Reason::cannot_write, fmt::format("{}: {}", path.string(), status.text()));
    return {};
  });
}

}  // namespace helicarm::xray

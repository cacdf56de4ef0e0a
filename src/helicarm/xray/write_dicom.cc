// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/write_dicom.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <memory>
#include <mutex>
#include <vector>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcrleerg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/core/system_message.h"
#include "helicarm/image/grey_image.h"
#include "helicarm/xray/dicom_text.h"
#include "helicarm/xray/dicom_time.h"
#include "helicarm/xray/uid.h"
#include "helicarm/xray/write_run.h"

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

struct SopClass {
  std::string_view modality;
  const char* uid;
};
constexpr SopClass xa{"XA", UID_XRayAngiographicImageStorage};
constexpr SopClass dx{"DX", UID_DigitalXRayImageStorageForPresentation};
constexpr std::array sop_classes = {xa, SopClass{"RF", UID_XRayRadiofluoroscopicImageStorage},
                                    SopClass{"CR", UID_ComputedRadiographyImageStorage}, dx};

/// A CR image has no place for the positioner's angles, a flip or what the grey values are of.
bool exceeds_cr(const Acquisition& a) {
  return a.primary_angle_deg || a.secondary_angle_deg || a.flip_hint || a.logarithmic;
}

SopClass class_of(const DerivedImage& image) {
  const Acquisition& a = image.acquisition;
  const auto found = std::ranges::find(sop_classes, a.modality, &SopClass::modality);
  if (found == sop_classes.end() || (found->modality == dx.modality && (!a.pixel_mm || !a.logarithmic)) ||
      (found->modality == "CR" && exceeds_cr(a)))
    return xa;
  return *found;
}

DcmTagKey key_of(std::uint32_t number) {
  return {static_cast<Uint16>(number >> 16), static_cast<Uint16>(number & 0xFFFF)};
}

/// Type 2: must be present, may be empty.
void put_empty(DcmDataset& dataset, std::initializer_list<DcmTagKey> tags) {
  for (const DcmTagKey& tag : tags)
    if (!dataset.tagExists(tag)) must(dataset.insertEmptyElement(tag), "empty element");
}

/// General modules, and of the image's class those without a value.
void put_required(DcmDataset& dataset, const SopClass& sop_class) {
  put_empty(dataset, {DCM_StudyDate, DCM_StudyTime, DCM_AccessionNumber, DCM_ReferringPhysicianName,
                      DCM_PatientBirthDate, DCM_PatientSex, DCM_StudyID, DCM_PatientOrientation});
  if (sop_class.modality == "DX")
    dataset.findAndDeleteElement(DCM_Laterality);
  else
    put_empty(dataset, {DCM_Laterality});
  if (sop_class.modality == "XA" || sop_class.modality == "RF")
    put_empty(dataset, {DCM_KVP, DCM_XRayTubeCurrent, DCM_ExposureTime, DCM_Exposure});
  if (sop_class.modality == "CR") put_empty(dataset, {DCM_BodyPartExamined, DCM_ViewPosition});
}

void put_source(DcmDataset& dataset, const DerivedImage& image, const SopClass& sop_class) {
  const auto& kept = image.patient_study;
  const std::string& uid = kept ? kept->sop_instance_uid : image.source_instance_uid;
  if (uid.empty()) return;
  DcmItem* item = nullptr;
  must(dataset.findOrCreateSequenceItem(DCM_SourceImageSequence, item, 0), "source image");
  must(
      item->putAndInsertString(DCM_ReferencedSOPClassUID, kept ? kept->sop_class_uid.c_str() : sop_class.uid),
      "source image");
  must(item->putAndInsertString(DCM_ReferencedSOPInstanceUID, uid.c_str()), "source image");
}

void put_identity(DcmDataset& dataset, const DerivedImage& image, const SopClass& sop_class) {
  const auto or_fresh = [](const std::string& uid) { return uid.empty() ? make_uid() : uid; };
  const bool planes = sop_class.modality == "XA" || sop_class.modality == "RF";
  put(dataset, DCM_SpecificCharacterSet, "ISO_IR 192");
  put(dataset, DCM_ImageType,
      fmt::format("{}{}", image.derived ? "DERIVED\\SECONDARY" : "ORIGINAL\\PRIMARY",
                  planes ? "\\SINGLE PLANE" : ""));
  put(dataset, DCM_SOPClassUID, sop_class.uid);
  put(dataset, DCM_SOPInstanceUID, or_fresh(image.instance_uid));
  put(dataset, DCM_SeriesInstanceUID, or_fresh(image.series_uid));
  put(dataset, DCM_Modality, std::string(sop_class.modality));
  put(dataset, DCM_Manufacturer, "helicarm");
  put(dataset, DCM_SoftwareVersions, HELICARM_VERSION);
  put(dataset, DCM_SeriesDescription, whole_characters(image.series_description));
  put(dataset, DCM_SeriesNumber, "1");
  put(dataset, DCM_InstanceNumber, "1");
  for (const auto& [number, value] : image.acquisition.technique) put(dataset, key_of(number), value);
  if (!image.derivation.empty()) put(dataset, DCM_DerivationDescription, image.derivation);
  put_source(dataset, image, sop_class);
  if (image.patient_study) {
    for (const auto& [number, value] : image.patient_study->elements) put(dataset, key_of(number), value);
    return;
  }
  put(dataset, DCM_PatientName, image.patient_name);
  put(dataset, DCM_PatientID, image.patient_id);
  put(dataset, DCM_StudyInstanceUID, or_fresh(image.study_uid));
  if (!image.derived) return;
  put(dataset, DCM_PatientIdentityRemoved, "YES");
  put(dataset, DCM_DeidentificationMethod, "Nothing of the source but geometry, technique and pixels");
}

/// The table by which logarithmic values become proportional to the dose (PS3.3 C.8.7.1.1.3 and C.11.1).
void put_dose_table(DcmDataset& dataset, const DerivedImage& image) {
  const std::size_t entries = std::size_t{1} << image.bits_stored;
  std::vector<Uint16> doses(entries);
  for (std::size_t i = 0; i < entries; ++i)
    doses[i] = static_cast<Uint16>(
        std::lround(65535 * std::exp(image.log_range * (double(i) / double(entries - 1) - 1))));
  DcmItem* item = nullptr;
  must(dataset.findOrCreateSequenceItem(DCM_ModalityLUTSequence, item, 0), "modality table");
  const std::array<Uint16, 3> descriptor = {static_cast<Uint16>(entries & 0xFFFF), 0, 16};
  must(item->putAndInsertUint16Array(DCM_LUTDescriptor, descriptor.data(), descriptor.size()),
       "modality table");
  must(item->putAndInsertString(DCM_ModalityLUTType, "US"), "modality table");
  must(item->putAndInsertString(DCM_LUTExplanation,
                                fmt::format("dose by exp, range {:.3f}{}", image.log_range,
                                            image.log_range == nominal_log_range ? " (nominal)" : "")
                                    .c_str()),
       "modality table");
  DcmTag words(DCM_LUTData);
  words.setVR(EVR_OW);
  auto data = std::make_unique<DcmOtherByteOtherWord>(words);
  must(data->putUint16Array(doses.data(), doses.size()), "modality table");
  must(item->insert(data.get(), true), "modality table");
  static_cast<void>(data.release());
}

void put_intensity(DcmDataset& dataset, const DerivedImage& image) {
  const auto& logarithmic = image.acquisition.logarithmic;
  put(dataset, DCM_PixelIntensityRelationship, !logarithmic ? "DISP" : *logarithmic ? "LOG" : "LIN");
  if (logarithmic.value_or(false)) put_dose_table(dataset, image);
}

/// PS3.3 10.7: the spacing accounts for a known magnification (GEOMETRY).
void put_object_spacing(DcmDataset& dataset, const ObjectSpacing& at) {
  put(dataset, DCM_PixelSpacing, fmt::format("{}\\{}", decimal(at.pixel_mm.y()), decimal(at.pixel_mm.x())));
  put(dataset, DCM_PixelSpacingCalibrationType, "GEOMETRY");
  const std::string figures =
      fmt::format("{:.1f} mm from the source, sigma {:.2g} %", at.source_object_mm, 100 * at.relative_sigma);
  const std::string_view separator = at.object.empty() ? "" : ": ";
  put(dataset, DCM_PixelSpacingCalibrationDescription,
      fmt::format("{}{}{}",
                  whole_characters(at.object, long_string_bytes - separator.size() - figures.size()),
                  separator, figures));
  put(dataset, DCM_DistanceSourceToPatient, decimal(at.source_object_mm));
  if (!at.source_detector_mm) return;
  put(dataset, DCM_DistanceSourceToDetector, decimal(*at.source_detector_mm));
  put(dataset, DCM_EstimatedRadiographicMagnificationFactor,
      decimal(*at.source_detector_mm / at.source_object_mm));
}

/// The source's time as it states it; not of an image without its patient.
void put_time(DcmDataset& dataset, const DerivedImage& image) {
  if (!image.acquisition.acquired || (image.derived && !image.patient_study)) return;
  const WrittenTime at = written_time(*image.acquisition.acquired);
  if (!at.is_of_content) return put(dataset, DCM_AcquisitionDateTime, at.date + at.time + at.offset);
  put(dataset, DCM_ContentDate, at.date);
  put(dataset, DCM_ContentTime, at.time);
  if (!at.offset.empty()) put(dataset, DCM_TimezoneOffsetFromUTC, at.offset);
}

void put_acquisition(DcmDataset& dataset, const DerivedImage& image, const SopClass& sop_class) {
  const Acquisition& a = image.acquisition;
  if (a.pixel_mm)
    put(dataset, DCM_ImagerPixelSpacing,
        fmt::format("{}\\{}", decimal(a.pixel_mm->y()), decimal(a.pixel_mm->x())));
  if (image.at_object)
    put_object_spacing(dataset, *image.at_object);
  else {
    if (a.source_detector_mm) put(dataset, DCM_DistanceSourceToDetector, decimal(*a.source_detector_mm));
    if (a.source_patient_mm) put(dataset, DCM_DistanceSourceToPatient, decimal(*a.source_patient_mm));
  }
  put_time(dataset, image);
  if (sop_class.modality == "CR") return;
  if (a.flip_hint) put(dataset, DCM_FieldOfViewHorizontalFlip, "YES");
  if (sop_class.modality != "RF" || a.primary_angle_deg || a.secondary_angle_deg) {
    put(dataset, DCM_PositionerPrimaryAngle, decimal(a.primary_angle_deg));
    put(dataset, DCM_PositionerSecondaryAngle, decimal(a.secondary_angle_deg));
  }
}

/// X-Ray Image and Acquisition modules.
void put_projection(DcmDataset& dataset, const DerivedImage& image) {
  if (!dataset.tagExists(DCM_RadiationSetting)) put(dataset, DCM_RadiationSetting, "GR");
  put_intensity(dataset, image);
}

/// DX modules, PS3.3 C.8.11.
void put_digital(DcmDataset& dataset, const DerivedImage& image) {
  const double levels = double(1 << image.bits_stored);
  put(dataset, DCM_PresentationIntentType, "FOR PRESENTATION");
  put(dataset, DCM_PositionerType, "CARM");
  if (!dataset.tagExists(DCM_ImageLaterality)) put(dataset, DCM_ImageLaterality, "U");
  if (!dataset.tagExists(DCM_BurnedInAnnotation)) put(dataset, DCM_BurnedInAnnotation, "YES");
  if (!dataset.tagExists(DCM_LossyImageCompression)) put(dataset, DCM_LossyImageCompression, "00");
  put_empty(dataset, {DCM_AnatomicRegionSequence, DCM_AcquisitionContextSequence, DCM_DetectorType});
  put(dataset, DCM_RescaleIntercept, "0");
  put(dataset, DCM_RescaleSlope, "1");
  put(dataset, DCM_RescaleType, "US");
  put(dataset, DCM_PresentationLUTShape, "IDENTITY");
  put(dataset, DCM_WindowCenter, decimal(levels / 2));
  put(dataset, DCM_WindowWidth, decimal(levels));
  put(dataset, DCM_PixelIntensityRelationship, *image.acquisition.logarithmic ? "LOG" : "LIN");
  must(dataset.putAndInsertSint16(DCM_PixelIntensityRelationshipSign, 1), "sign");
}

/// Frames of a run and their angles (PS3.3 C.8.7.5).
void put_motion(DcmDataset& dataset, const RunFrames& run) {
  put(dataset, DCM_PositionerMotion, run.further.empty() ? "STATIC" : "DYNAMIC");
  if (run.further.empty()) return;
  put(dataset, DCM_NumberOfFrames, std::to_string(run.further.size() + 1));
  put(dataset, DCM_FrameTime, "33.333");
  must(dataset.putAndInsertTagKey(DCM_FrameIncrementPointer, DCM_FrameTime), "frame increment pointer");
  std::string primary, secondary;
  for (const Eigen::Vector2d& increment : run.angle_increments_deg) {
    primary += (primary.empty() ? "" : "\\") + decimal(increment.x());
    secondary += (secondary.empty() ? "" : "\\") + decimal(increment.y());
  }
  put(dataset, DCM_PositionerPrimaryAngleIncrement, primary);
  put(dataset, DCM_PositionerSecondaryAngleIncrement, secondary);
}

void put_modules(DcmDataset& dataset, const DerivedImage& image, const RunFrames& run) {
  const SopClass sop_class = class_of(image);
  put_identity(dataset, image, sop_class);
  put_acquisition(dataset, image, sop_class);
  if (sop_class.modality == "XA") put_motion(dataset, run);
  if (sop_class.modality == "XA" || sop_class.modality == "RF") put_projection(dataset, image);
  if (sop_class.modality == "DX") put_digital(dataset, image);
  put_required(dataset, sop_class);
}

void put_pixels(DcmDataset& dataset, const DerivedImage& image, const RunFrames& run) {
  const int allocated = image.bits_stored > 8 ? 16 : 8;
  put(dataset, DCM_SamplesPerPixel, 1);
  put(dataset, DCM_PhotometricInterpretation, "MONOCHROME2");
  put(dataset, DCM_Rows, image.pixels.height());
  put(dataset, DCM_Columns, image.pixels.width());
  put(dataset, DCM_BitsAllocated, allocated);
  put(dataset, DCM_BitsStored, image.bits_stored);
  put(dataset, DCM_HighBit, image.bits_stored - 1);
  put(dataset, DCM_PixelRepresentation, 0);
  // Filled in place: a run may have gigabytes.
  auto data = std::make_unique<DcmPixelData>(DCM_PixelData);
  const std::size_t count = image.pixels.pixels().size() * (run.further.size() + 1);
  const auto fill = [&](auto* values) {
    values = std::ranges::copy(image.pixels.pixels(), values).out;
    for (const auto* further : run.further) values = std::ranges::copy(further->pixels(), values).out;
  };
  if (allocated == 16) {
    data->setVR(EVR_OW);
    Uint16* words = nullptr;
    must(data->createUint16Array(static_cast<Uint32>(count), words), "pixels");
    fill(words);
  } else {
    data->setVR(EVR_OB);
    Uint8* bytes = nullptr;
    must(data->createUint8Array(static_cast<Uint32>(count), bytes), "pixels");
    fill(bytes);
  }
  must(dataset.insert(data.get(), true), "pixels");
  static_cast<void>(data.release());
}

void check(const fs::path& path, const image::Image<std::uint16_t>& pixels, int bits_stored) {
  const auto side = static_cast<int>(image::max_image_side);
  if (pixels.empty() || pixels.width() > side || pixels.height() > side)
    throw BadInput(Reason::bad_size, fmt::format("{}: {} x {} pixels, must be 1 to {} a side", path.string(),
                                                 pixels.width(), pixels.height(), side));
  const int limit = (1 << bits_stored) - 1;
  const int greatest = *std::ranges::max_element(pixels.pixels());
  if (bits_stored < 8 || bits_stored > 16 || greatest > limit)
    throw BadInput(Reason::bad_value, fmt::format("{}: pixel value {} does not fit in {} bits (8 to 16)",
                                                  path.string(), greatest, bits_stored));
}

void check_frames(const fs::path& path, const DerivedImage& image, const RunFrames& run) {
  constexpr std::size_t most_bytes = 0xFFFFFFF0;  // of uncompressed pixel data
  const std::size_t frames = run.further.size() + 1;
  if (2 * image.pixels.pixels().size() * frames > most_bytes)
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {} frames of {} x {} exceed the 4 GB of a DICOM file", path.string(),
                               frames, image.pixels.width(), image.pixels.height()));
  for (const auto* further : run.further) {
    if (further->width() != image.pixels.width() || further->height() != image.pixels.height())
      throw BadInput(Reason::bad_size, fmt::format("{}: its frames differ in size", path.string()));
    check(path, *further, image.bits_stored);
  }
  if (frames > 1 && run.angle_increments_deg.size() != frames)
    throw BadInput(Reason::bad_value, fmt::format("{}: {} angle increments of {} frames", path.string(),
                                                  run.angle_increments_deg.size(), frames));
}

}  // namespace

Expected<void> write_dicom(const fs::path& path, const DerivedImage& image) {
  return write_run(path, image, {});
}

Expected<void> write_run(const fs::path& path, const DerivedImage& image, const RunFrames& run) {
  const E_TransferSyntax syntax = image.rle ? EXS_RLELossless : EXS_LittleEndianExplicit;
  const auto file = guarded([&] {
    check(path, image.pixels, image.bits_stored);
    check_frames(path, image, run);
    prepare_dcmtk();
    auto dicom = std::make_unique<DcmFileFormat>();
    DcmDataset& dataset = *dicom->getDataset();
    put_modules(dataset, image, run);
    put_pixels(dataset, image, run);
    must(dataset.chooseRepresentation(syntax, nullptr), "compression");
    return dicom;
  });
  if (!file) return tl::unexpected<Failure>(file.error());
  return write_file_with(path, [&](const fs::path& aside) -> Expected<void> {
    if (image.patient_study)
      if (auto created = make_private_file(aside); !created) return created;
    errno = 0;
    const OFCondition status = (*file)->saveFile(aside.c_str(), syntax);
    if (status.good()) return {};
    const int error = errno;  // DCMTK calls a full disk "I/O suspension"
    return fail(Reason::cannot_write, fmt::format("{}: cannot be written: {}", path.string(),
                                                  error != 0 ? system_message(error) : status.text()));
  });
}

}  // namespace helicarm::xray

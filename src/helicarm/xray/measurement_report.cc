// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/measurement_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/xray/dataset_writing.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/uid.h"

namespace helicarm::xray {
namespace {

Code dcm(const char* value, const char* meaning) { return {value, "DCM", meaning}; }
Code sct(const char* value, const char* meaning) { return {value, "SCT", meaning}; }

void put_code(DcmItem& item, const DcmTagKey& sequence, const Code& code) {
  DcmItem& made = item_in(item, sequence);
  // A short code value has at most sixteen characters.
  put_in(made, code.value.size() > 16 ? DCM_LongCodeValue : DCM_CodeValue, code.value);
  put_in(made, DCM_CodingSchemeDesignator, code.scheme);
  put_in(made, DCM_CodeMeaning, code.meaning);
}

/// One after the last item of the content.
DcmItem& content_in(DcmItem& parent, const char* relationship, const char* type,
                    const std::optional<Code>& name) {
  DcmSequenceOfItems* content = nullptr;
  const long at = parent.findAndGetSequence(DCM_ContentSequence, content).good() ? long(content->card()) : 0;
  DcmItem& item = item_in(parent, DCM_ContentSequence, at);
  put_in(item, DCM_RelationshipType, relationship);
  put_in(item, DCM_ValueType, type);
  if (name) put_code(item, DCM_ConceptNameCodeSequence, *name);
  return item;
}

DcmItem& container_in(DcmItem& parent, const Code& name) {
  DcmItem& item = content_in(parent, "CONTAINS", "CONTAINER", name);
  put_in(item, DCM_ContinuityOfContent, "SEPARATE");
  return item;
}

DcmItem& code_in(DcmItem& parent, const char* relationship, const Code& name, const Code& value) {
  DcmItem& item = content_in(parent, relationship, "CODE", name);
  put_code(item, DCM_ConceptCodeSequence, value);
  return item;
}

void text_in(DcmItem& parent, const char* relationship, const Code& name, const std::string& value) {
  put_in(content_in(parent, relationship, "TEXT", name), DCM_TextValue, value);
}

void uid_in(DcmItem& parent, const Code& name, const std::string& value) {
  put_in(content_in(parent, "HAS OBS CONTEXT", "UIDREF", name), DCM_UID, value);
}

void image_in(DcmItem& item, const ReportImage& image) {
  DcmItem& referenced = item_in(item, DCM_ReferencedSOPSequence);
  put_in(referenced, DCM_ReferencedSOPClassUID, image.patient_study.sop_class_uid);
  put_in(referenced, DCM_ReferencedSOPInstanceUID, image.patient_study.sop_instance_uid);
  if (image.frame) put_in(referenced, DCM_ReferencedFrameNumber, std::to_string(*image.frame));
}

void template_in(DcmItem& item, const char* identifier) {
  DcmItem& used = item_in(item, DCM_ContentTemplateSequence);
  put_in(used, DCM_MappingResource, "DCMR");
  put_in(used, DCM_TemplateIdentifier, identifier);
}

void number_in(DcmItem& item, double value, const Code& unit) {
  DcmItem& measured = item_in(item, DCM_MeasuredValueSequence);
  put_in(measured, DCM_NumericValue, decimal_string(value));
  put_code(measured, DCM_MeasurementUnitsCodeSequence, unit);
}

void graphic_in(DcmItem& item, std::span<const float> numbers, const char* type) {
  put_in(item, DCM_GraphicType, type);
  if (item.putAndInsertFloat32Array(DCM_GraphicData, numbers.data(), numbers.size()).bad())
    throw BadInput(Reason::cannot_write, "DICOM: coordinates cannot be stored");
}

/// TID 320: where the value is from.
void put_places(DcmItem& number, const ReportValue& value, const MeasurementReport& report) {
  const Code purpose = value.path.size() > 1 ? dcm("121055", "Path") : dcm("111010", "Center");
  if (!value.path.empty()) {
    std::vector<float> numbers;
    for (const Eigen::Vector3d& point : value.path)
      for (const double coordinate : point) numbers.push_back(float(coordinate));
    DcmItem& item = content_in(number, "INFERRED FROM", "SCOORD3D", purpose);
    graphic_in(item, numbers, value.path.size() > 1 ? "POLYLINE" : "POINT");
    put_in(item, DCM_ReferencedFrameOfReferenceUID, report.frame_of_reference_uid);
  }
  for (const ReportMark& mark : value.marks) {
    // PS3.3 C.18.6.1.1: the origin is the corner of the first pixel.
    const std::array numbers = {float(mark.uv.x() + 0.5), float(mark.uv.y() + 0.5)};
    DcmItem& item = content_in(number, "INFERRED FROM", "SCOORD", purpose);
    graphic_in(item, numbers, "POINT");
    image_in(content_in(item, "SELECTED FROM", "IMAGE", std::nullopt), report.images.at(mark.image));
  }
}

/// TID 300.
void put_value(DcmItem& group, const ReportValue& value, const MeasurementReport& report) {
  DcmItem& number = content_in(group, "CONTAINS", "NUM", value.name);
  if (value.value) {
    number_in(number, *value.value, value.unit);
  } else {
    number.insertEmptyElement(DCM_MeasuredValueSequence);
    put_code(number, DCM_NumericValueQualifierCodeSequence, dcm("114006", "Measurement failure"));
  }
  const auto property = [&](const Code& name, double of) -> DcmItem& {
    DcmItem& item = content_in(number, "HAS PROPERTIES", "NUM", name);
    number_in(item, of, value.unit);
    return item;
  };
  if (value.sigma) property(sct("386136009", "Standard Deviation"), *value.sigma);
  if (value.within_95)
    code_in(property(sct("371884006", "+/-, range of measurement uncertainty"), *value.within_95),
            "HAS CONCEPT MOD", sct("370129005", "Measurement Method"),
            {"half_width_95", own_scheme, "Half width of the 95 % confidence interval"});
  const auto& patient_study = report.images.front().patient_study;
  if (!value.comment.empty())
    text_in(number, "HAS PROPERTIES", dcm("121106", "Comment"), own_text(patient_study, value.comment));
  put_places(number, value, report);
}

/// TID 1501.
void put_group(DcmItem& parent, const ReportGroup& group, const MeasurementReport& report) {
  const PatientStudy& patient_study = report.images.front().patient_study;
  DcmItem& item = container_in(parent, dcm("125007", "Measurement Group"));
  template_in(item, "1501");
  text_in(item, "HAS OBS CONTEXT", dcm("112039", "Tracking Identifier"), own_text(patient_study, group.name));
  uid_in(item, dcm("112040", "Tracking Unique Identifier"),
         uid_of(text_key(fmt::format("tracked {} {} {}", report.frame_of_reference_uid, group.finding.value,
                                     group.name))));
  code_in(item, "CONTAINS", dcm("121071", "Finding"), group.finding);
  for (const ReportValue& value : group.values) put_value(item, value, report);
}

/// TID 1204, 1001 and 1600.
void put_context(DcmDataset& root, const MeasurementReport& report) {
  code_in(root, "HAS CONCEPT MOD", dcm("121049", "Language of Content Item and Descendants"),
          {"en", "RFC5646", "English"});
  code_in(root, "HAS OBS CONTEXT", dcm("121005", "Observer Type"), dcm("121007", "Device"));
  uid_in(root, dcm("121012", "Device Observer UID"), uid_of(text_key("helicarm " HELICARM_VERSION)));
  text_in(root, "HAS OBS CONTEXT", dcm("121013", "Device Observer Name"), "helicarm " HELICARM_VERSION);
  code_in(root, "HAS CONCEPT MOD", dcm("121058", "Procedure reported"),
          sct("363679005", "Imaging procedure"));
  DcmItem& library = container_in(root, dcm("111028", "Image Library"));
  DcmItem& images = container_in(library, dcm("126200", "Image Library Group"));
  for (const ReportImage& image : report.images)
    image_in(content_in(images, "CONTAINS", "IMAGE", std::nullopt), image);
}

/// Each image once, by study and series.
void put_evidence(DcmDataset& dataset, const MeasurementReport& report) {
  std::map<std::string, std::map<std::string, std::map<std::string, std::string>>> studies;
  for (const ReportImage& image : report.images)
    studies[image.patient_study.elements.at(tags::study.number)][image.series_uid]
           [image.patient_study.sop_instance_uid] = image.patient_study.sop_class_uid;
  long at_study = 0;
  for (const auto& [study, all_series] : studies) {
    DcmItem& of_study = item_in(dataset, DCM_CurrentRequestedProcedureEvidenceSequence, at_study++);
    put_in(of_study, DCM_StudyInstanceUID, study);
    long at_series = 0;
    for (const auto& [series, instances] : all_series) {
      DcmItem& of_series = item_in(of_study, DCM_ReferencedSeriesSequence, at_series++);
      put_in(of_series, DCM_SeriesInstanceUID, series);
      long at = 0;
      for (const auto& [instance, sop_class] : instances) {
        DcmItem& item = item_in(of_series, DCM_ReferencedSOPSequence, at++);
        put_in(item, DCM_ReferencedSOPClassUID, sop_class);
        put_in(item, DCM_ReferencedSOPInstanceUID, instance);
      }
    }
  }
}

/// What the UIDs follow from.
std::string content_of(const MeasurementReport& report) {
  std::string content = "measurement report " + report.frame_of_reference_uid;
  const auto add = [&](std::optional<double> number) {
    content += number ? " " + decimal_string(*number) : std::string(" -");
  };
  for (const ReportImage& image : report.images)
    content += fmt::format(" {} {}", image.patient_study.sop_instance_uid, image.frame.value_or(0));
  for (const ReportGroup& group : report.groups) {
    content += fmt::format("\n{} {}", group.finding.value, group.name);
    for (const ReportValue& value : group.values) {
      content += fmt::format("\n{} {} {}", value.name.value, value.unit.value, value.comment);
      for (const auto& number : {value.value, value.sigma, value.within_95}) add(number);
      for (const Eigen::Vector3d& point : value.path)
        for (const double coordinate : point) add(coordinate);
      for (const ReportMark& mark : value.marks)
        content += fmt::format(" {} {:.9g} {:.9g}", mark.image, mark.uv.x(), mark.uv.y());
    }
  }
  return content;
}

void check_report(const MeasurementReport& report) {
  if (report.images.empty()) throw BadInput(Reason::bad_value, "measurement report: it has no image");
  if (report.groups.empty()) throw BadInput(Reason::bad_value, "measurement report: it has no measurement");
  const auto is_finite = [](const std::optional<double>& number) {
    return !number || std::isfinite(*number);
  };
  for (const ReportGroup& group : report.groups)
    for (const ReportValue& value : group.values)
      if (!is_finite(value.value) || !is_finite(value.sigma) || !is_finite(value.within_95) ||
          !std::ranges::all_of(value.path, [](const auto& point) { return point.allFinite(); }) ||
          !std::ranges::all_of(value.marks, [](const auto& mark) { return mark.uv.allFinite(); }))
        throw BadInput(Reason::bad_value, fmt::format("measurement report: {}: {} is not finite", group.name,
                                                      value.name.meaning));
}

void put_report(DcmDataset& dataset, const MeasurementReport& report) {
  put_object(dataset, UID_Comprehensive3DSRStorage, "SR", content_of(report),
             report.images.front().patient_study);
  put_in(dataset, DCM_SeriesDescription, "measurements");
  put_in(dataset, DCM_ManufacturerModelName, "helicarm");
  put_in(dataset, DCM_DeviceSerialNumber, "none");
  put_in(dataset, DCM_CompletionFlag, "COMPLETE");
  put_in(dataset, DCM_VerificationFlag, "UNVERIFIED");
  for (const DcmTagKey& tag :
       {DCM_ReferencedPerformedProcedureStepSequence, DCM_PerformedProcedureCodeSequence})
    dataset.insertEmptyElement(tag);
  put_evidence(dataset, report);
  put_in(dataset, DCM_ValueType, "CONTAINER");
  put_in(dataset, DCM_ContinuityOfContent, "SEPARATE");
  put_code(dataset, DCM_ConceptNameCodeSequence, dcm("126000", "Imaging Measurement Report"));
  template_in(dataset, "1500");
  put_context(dataset, report);
  DcmItem& measurements = container_in(dataset, dcm("126010", "Imaging Measurements"));
  for (const ReportGroup& group : report.groups) put_group(measurements, group, report);
}

}  // namespace

Expected<std::optional<ReportImage>> report_image_of(const std::filesystem::path& file,
                                                     std::optional<int> frame) {
  return guarded([&]() -> std::optional<ReportImage> {
    const std::string bytes = value_or_throw(read_file(file, max_image_file_bytes));
    if (!looks_like_dicom(bytes)) return std::nullopt;
    const DicomOutline outline = value_or_throw(check_dicom(bytes, file.filename().string()));
    ReportImage image{patient_study_in(outline.elements), std::string(outline.elements.text(tags::series))};
    if (outline.frames > 1) image.frame = frame;
    if (!image.patient_study.elements.contains(tags::study.number) || image.series_uid.empty() ||
        image.patient_study.sop_instance_uid.empty())
      return std::nullopt;
    return image;
  });
}

Expected<void> write_measurement_report(const std::filesystem::path& path, const MeasurementReport& report) {
  return guarded([&] {
    check_report(report);
    DcmFileFormat file;
    put_report(*file.getDataset(), report);
    value_or_throw(save_private(path, file));
  });
}

}  // namespace helicarm::xray

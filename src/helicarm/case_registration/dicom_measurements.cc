// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/dicom_measurements.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/case_registration/dicom_registrations.h"
#include "helicarm/core/statistics.h"
#include "helicarm/pipeline/view_image.h"
#include "helicarm/report/earlier_results.h"
#include "helicarm/xray/dicom_tags.h"
#include "helicarm/xray/read_dicom.h"

namespace helicarm::case_registration {
namespace {

using xray::Code;
using xray::ReportGroup;
using xray::ReportMark;
using xray::ReportValue;

Code in_mm() { return {"mm", "UCUM", "mm"}; }
Code in_degrees() { return {"deg", "UCUM", "deg"}; }
Code in_percent() { return {"%", "UCUM", "%"}; }
Code length_code() { return {"410668003", "SCT", "Length"}; }
Code angle_code() { return {"1483009", "SCT", "Angle"}; }

Code own_code(std::string value, const std::string& meaning) {
  return {std::move(value), xray::own_scheme, meaning.substr(0, 64)};
}

ReportValue value_of(const Code& name, const Code& unit, double value, std::optional<double> sigma = {}) {
  return {name, unit, value, sigma, sigma ? std::optional(normal_at_975 * *sigma) : std::nullopt};
}

ReportValue failed_value(const Code& name, const Code& unit, std::string why) {
  ReportValue failed{name, unit, {}};
  failed.comment = std::move(why);
  return failed;
}

std::string sentences_of(const std::vector<Warning>& warnings) {
  std::string text;
  for (const Warning& warning : warnings)
    text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", code(warning.reason), warning.message);
  return text;
}

Code error_code() { return own_code("error_95", "Distance that 95 % of the errors do not exceed"); }

std::vector<ReportValue> values_of_place(const guidance::PointInFrames& place,
                                         std::vector<ReportMark> marks = {}, std::string comment = {}) {
  std::vector<ReportValue> values;
  constexpr std::array axes{"X", "Y", "Z"};
  for (Eigen::Index i = 0; i < 3; ++i)
    values.push_back(value_of(
        own_code(fmt::format("position_{}", "xyz"[i]), fmt::format("{} coordinate", axes[std::size_t(i)])),
        in_mm(), place.in_calibrator[i], std::sqrt(std::max(0.0, place.covariance_in_calibrator(i, i)))));
  ReportValue within =
      value_of(error_code(), in_mm(), localization::length_at_95(place.covariance_in_calibrator));
  within.path = {place.in_calibrator};
  within.marks = std::move(marks);
  within.comment = std::move(comment);
  values.push_back(std::move(within));
  return values;
}

std::vector<ReportMark> marks_of(const pipeline::PointResult& point,
                                 const std::vector<std::optional<std::size_t>>& images) {
  std::vector<ReportMark> marks;
  for (std::size_t v = 0; v < std::min(point.seen.size(), images.size()); ++v)
    if (point.seen[v] && images[v]) marks.push_back({*images[v], point.seen[v]->uv_raw});
  return marks;
}

ReportGroup group_of(const pipeline::PointResult& point,
                     const std::vector<std::optional<std::size_t>>& images) {
  ReportGroup group{point.name,
                    point.source == localization::PointSource::pick ? own_code("point", "Located point")
                                                                    : own_code("target", "Check target"),
                    {}};
  if (point.place)
    group.values = values_of_place(*point.place, marks_of(point, images), sentences_of(point.warnings));
  else
    group.values = {failed_value(error_code(), in_mm(),
                                 point.reason ? sentences_of({*point.reason}) : "it is not located")};
  return group;
}

/// Length and axis of a planned tunnel; `path`: empty where an end is not located.
std::vector<ReportValue> values_of_tunnel(const guidance::Tunnel& tunnel, std::vector<Eigen::Vector3d> path) {
  if (path.empty()) return {failed_value(length_code(), in_mm(), "an end is not located")};
  ReportValue length = value_of(length_code(), in_mm(), tunnel.length_mm.value_or((path[1] - path[0]).norm()),
                                tunnel.length_sigma_mm);
  length.path = std::move(path);
  std::vector<ReportValue> values{std::move(length)};
  if (const auto sigma = tunnel.axis_sigma_deg())
    values.push_back(
        value_of(own_code("axis_sigma", "Standard deviation of the axis"), in_degrees(), *sigma));
  return values;
}

void add_bone_check(const guidance::BoneCheck& check, std::vector<ReportValue>& values) {
  if (check.bridge_mm)
    values.push_back(value_of(own_code("bridge", "Distance of the wall from the bone's surface"), in_mm(),
                              *check.bridge_mm,
                              check.drilled_sigma_mm ? check.drilled_sigma_mm : check.sigma_mm));
  if (check.end_mm)
    values.push_back(value_of(own_code("end", "Bone ahead of the tunnel's end"), in_mm(), *check.end_mm,
                              check.drilled_end_sigma_mm ? check.drilled_end_sigma_mm : check.end_sigma_mm));
  values.push_back(
      value_of(own_code("length_in_bone", "Length in the bone"), in_mm(), check.length_in_bone_mm));
  if (check.entry_angle_deg)
    values.push_back(value_of(own_code("entry_angle", "Angle between axis and surface at the entry"),
                              in_degrees(), *check.entry_angle_deg));
  if (check.exit_angle_deg)
    values.push_back(value_of(own_code("exit_angle", "Angle between axis and surface at the exit"),
                              in_degrees(), *check.exit_angle_deg));
  for (const guidance::TunnelDistance& other : check.to_tunnels) {
    values.push_back(
        value_of(own_code("to_tunnel", "Distance to another tunnel's wall"), in_mm(), other.distance_mm));
    values.back().comment = other.tunnel;
  }
}

void add_tunnels(const pipeline::Result& result, std::vector<ReportGroup>& groups) {
  const Code planned = own_code("tunnel", "Planned tunnel");
  for (std::size_t i = 0; i < std::min(result.tunnels.size(), result.tunnel_ends.size()); ++i) {
    const pipeline::TunnelEnds& ends = result.tunnel_ends[i];
    const auto &start = result.points[ends.start].place, &end = result.points[ends.end].place;
    std::vector<Eigen::Vector3d> path;
    if (start && end) path = {start->in_calibrator, end->in_calibrator};
    groups.push_back({result.tunnels[i].name, planned, values_of_tunnel(result.tunnels[i], path)});
  }
  for (const pipeline::ModelTunnel& of : result.model_tunnels) {
    ReportGroup group{fmt::format("{}: {}", of.model, of.tunnel.name), planned,
                      values_of_tunnel(of.tunnel, {result.model_points[of.ends.start].place.in_calibrator,
                                                   result.model_points[of.ends.end].place.in_calibrator})};
    if (of.bone_check) add_bone_check(*of.bone_check, group.values);
    groups.push_back(std::move(group));
  }
}

/// Eq. 17: the instrument's line against the plan.
void add_tool_lines(const pipeline::Result& result, std::vector<ReportGroup>& groups) {
  for (std::size_t i = 0; i < result.verifications.size(); ++i) {
    const guidance::Verification& line = result.verifications[i];
    ReportGroup group{line.name, own_code("tool_line", "Line of the instrument"), {}};
    for (const auto& [end, error] : {std::pair{"start", &line.start}, std::pair{"end", &line.end}}) {
      const Code name =
          own_code(fmt::format("off_{}", end), fmt::format("Distance from the planned {}", end));
      group.values.push_back(*error ? value_of(name, in_mm(), (*error)->distance_mm)
                                    : failed_value(name, in_mm(), "the planned point is not located"));
    }
    if (line.depth)
      group.values.push_back(value_of(own_code("beyond_end", "Tip of the drill beyond the planned end"),
                                      in_mm(), line.depth->beyond_end_mm, line.depth->sigma_mm));
    if (i < result.tool_lines.size())
      group.values.front().path = {result.tool_lines[i].p1_in_calibrator,
                                   result.tool_lines[i].p2_in_calibrator};
    groups.push_back(std::move(group));
  }
}

Code name_of(const measures::Quantity& quantity) {
  if (quantity.name == "length") return length_code();
  if (quantity.name == "angle") return angle_code();
  std::string meaning = quantity.name;
  std::ranges::replace(meaning, '_', ' ');
  return own_code(quantity.name, meaning);
}

ReportGroup group_of(const measures::InBone& measure) {
  const measures::KindInfo& info = measures::info_of(measure.measure.kind);
  ReportGroup group{fmt::format("{}: {}", measure.model, measure.name),
                    own_code(std::string(info.word), std::string(info.label)),
                    {}};
  for (const measures::Quantity& one : measure.measure.quantities)
    group.values.push_back(
        value_of(name_of(one), one.unit == "deg" ? in_degrees() : in_mm(), one.value, one.sigma));
  for (const measures::Position& position : measure.measure.positions)
    for (Eigen::Index i = 0; i < position.percent.size(); ++i) {
      const std::string component(info.components[std::size_t(i)]);
      group.values.push_back(value_of(own_code(component, "Position, " + component), in_percent(),
                                      position.percent[i],
                                      std::sqrt(std::max(0.0, position.covariance(i, i)))));
      const std::string warnings = sentences_of(position.warnings);
      group.values.back().comment = position.point + (warnings.empty() ? "" : ": " + warnings);
    }
  for (const std::string& point : measure.missing)
    for (const std::string_view component : info.components)
      group.values.push_back(
          failed_value(own_code(std::string(component), fmt::format("Position, {}", component)), in_percent(),
                       point + ": it is not located"));
  return group;
}

void check_one_patient(const std::vector<xray::ReportImage>& images) {
  for (const xray::ReportImage& image : images)
    for (const xray::DicomTag tag : {xray::tags::patient_id, xray::tags::patient_name}) {
      const auto of = [&](const xray::ReportImage& one) {
        const auto found = one.patient_study.elements.find(tag.number);
        return found == one.patient_study.elements.end() ? std::string() : found->second;
      };
      if (of(image) != of(images.front()))
        throw BadInput(
            Reason::patient_mismatch,
            fmt::format("the images are of two patients ({}): no DICOM report holds both", tag.name));
    }
}

std::vector<std::string> names_of_views(const Measurement& measured) {
  std::vector<std::string> names;
  for (const pipeline::ViewResult& view : measured.result.views) names.push_back(view.name);
  if (names.empty() && measured.registration)
    for (const registration::RegistrationView& view : measured.registration->loaded.views)
      names.push_back(view.name);
  return names;
}

/// What shows that an image is not the one measured in view `index`; empty: nothing.
std::string difference_from_measured(const xray::XrayImage& image, const Measurement& measured,
                                     std::size_t index) {
  const xray::Acquisition& a = image.acquisition;
  if (measured.result.views.empty()) {
    const LoadedViews& loaded = measured.registration->loaded;
    if (!a.patient_key.empty() && a.patient_key != loaded.patient_key) return "patient";
    const auto map = loaded.maps[index] ? *loaded.maps[index] : rectification::flat_panel_map(image);
    const bool is_same =
        xray::image_key(rectification::resample(image, map)) == xray::image_key(loaded.views[index].grey);
    return is_same ? "" : "pixels";
  }
  const auto& of_result = measured.result.views[index].xray_image;
  if (!of_result) return "";
  const xray::Acquisition& b = of_result->acquisition;
  if (a.patient_key != b.patient_key) return "patient";
  if (a.study_key != b.study_key) return "study";
  if (a.uid_key != b.uid_key) return "SOP Instance UID or frame";
  return a.instance_key == b.instance_key ? "" : "pixels";
}

/// Patient and study are taken from the case's files, which must be what was measured.
void check_is_measured(const pipeline::Case& the_case, const Measurement& measured) {
  std::vector<std::string> names;
  for (const pipeline::CaseView& view : the_case.views) names.push_back(view.name);
  if (const auto found = names_of_views(measured); names != found)
    throw BadInput(Reason::bad_value,
                   fmt::format("the case has the views {}, what was measured {}: it is another case",
                               fmt::join(names, ", "), fmt::join(found, ", ")));
  for (std::size_t i = 0; i < names.size(); ++i) {
    const xray::XrayImage image = value_or_throw(pipeline::image_of(the_case.views[i]));
    const std::string difference = difference_from_measured(image, measured, i);
    if (difference.empty()) continue;
    throw BadInput({difference == "patient" ? Reason::patient_mismatch : Reason::bad_value,
                    fmt::format("{} is not the image that was measured: its {} differs",
                                the_case.views[i].image.filename().string(), difference),
                    names[i],
                    {}});
  }
  // Of an operation the models are its plan's, and no registration of theirs is written.
  if (!measured.registration || the_case.models.empty()) return;
  const auto& models = measured.registration->models;
  for (std::size_t i = 0; i < models.size(); ++i)
    if (i >= the_case.models.size() || models[i].registration.name != the_case.models[i].name)
      throw BadInput(Reason::bad_value, fmt::format("the case has not the model \"{}\" that was registered",
                                                    models[i].registration.name));
}

std::string frame_uid_of_views(const Measurement& measured) {
  if (measured.registration) return calibrator_frame_uid(*measured.registration);
  std::vector<geometry::View> views;
  for (const pipeline::ViewResult& view : measured.result.views)
    if (view.calibrated) views.push_back(view.calibrated->view);
  return calibrator_frame_uid(views);
}

constexpr const char* nothing_measured =
    "the case has neither points nor tunnels: a DICOM measurement report would be empty";
constexpr const char* no_image =
    "no view's image is a DICOM file that states its study, series and instance, which a DICOM measurement "
    "report needs";
constexpr const char* no_series =
    "no \"volume\" is a folder of a DICOM CT series that states its Frame of Reference UID (0020,0052), "
    "which "
    "a DICOM registration needs";

}  // namespace

std::vector<ReportGroup> report_groups(const Measurement& measured,
                                       const std::vector<std::optional<std::size_t>>& images) {
  const pipeline::Result& result = measured.result;
  std::vector<ReportGroup> groups;
  for (const pipeline::PointResult& point : result.points) groups.push_back(group_of(point, images));
  for (const pipeline::ModelPoint& point : result.model_points)
    groups.push_back({fmt::format("{}: {}", point.model, point.name),
                      own_code("planned_point", "Planned point"), values_of_place(point.place)});
  add_tunnels(result, groups);
  add_tool_lines(result, groups);
  if (measured.registration)
    for (const RegisteredModel& model : measured.registration->models)
      for (const measures::InBone& measure : model.measures) groups.push_back(group_of(measure));
  return groups;
}

Expected<std::optional<std::string>> write_dicom_measurements(const pipeline::Case& the_case,
                                                              const Measurement& measured,
                                                              const std::filesystem::path& file) {
  return guarded([&]() -> std::optional<std::string> {
    if (measured.result.failure) throw BadInput(*measured.result.failure);
    check_is_measured(the_case, measured);
    xray::MeasurementReport report;
    std::vector<std::optional<std::size_t>> of_views;
    for (const pipeline::CaseView& view : the_case.views) {
      auto image = value_or_throw(xray::report_image_of(view.image, view.frame));
      of_views.push_back(image ? std::optional(report.images.size()) : std::nullopt);
      if (image) report.images.push_back(*std::move(image));
    }
    if (report.images.empty()) return no_image;
    check_one_patient(report.images);
    report.frame_of_reference_uid = frame_uid_of_views(measured);
    report.groups = report_groups(measured, of_views);
    if (report.groups.empty()) return nothing_measured;
    value_or_throw(xray::write_measurement_report(file, report));
    return std::nullopt;
  });
}

Expected<DicomResults> write_available_dicom(const pipeline::Case& the_case, const Measurement& measured,
                                             const std::filesystem::path& folder,
                                             const std::filesystem::path& registrations) {
  return guarded([&] {
    DicomResults results;
    if (measured.result.failure && measured.registration) check_is_measured(the_case, measured);
    if (!measured.result.failure) {
      const std::filesystem::path file = folder / report::dicom_measurements_name;
      if (auto why = value_or_throw(write_dicom_measurements(the_case, measured, file)))
        results.left_out.push_back(*std::move(why));
      else
        results.files.push_back(file);
    }
    if (measured.registration) {
      if (const auto files =
              value_or_throw(write_dicom_registrations(the_case, *measured.registration, registrations)))
        results.files.insert(results.files.end(), files->begin(), files->end());
      else
        results.left_out.emplace_back(no_series);
    }
    return results;
  });
}

Expected<DicomResults> write_dicom_results(const pipeline::Case& the_case, const Measurement& measured,
                                           const std::filesystem::path& folder,
                                           const std::filesystem::path& registrations) {
  return write_available_dicom(the_case, measured, folder, registrations)
      .and_then([](DicomResults results) -> Expected<DicomResults> {
        if (results.files.empty() && !results.left_out.empty())
          return fail(Reason::bad_value, fmt::format("--dicom: {}", fmt::join(results.left_out, "; ")));
        return results;
      });
}

}  // namespace helicarm::case_registration

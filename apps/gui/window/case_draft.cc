// SPDX-License-Identifier: Apache-2.0
#include "gui/window/case_draft.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/xray/read_xray_image.h"

namespace helicarm::gui {
namespace fs = std::filesystem;

namespace {

std::string found_in(const pipeline::InspectedImage& image) {
  const xray::Acquisition& a = image.xray_image.acquisition;
  std::string text =
      fmt::format("{} x {}", image.xray_image.pixels.width(), image.xray_image.pixels.height());
  text += a.pixel_mm ? fmt::format(", {:.4g} mm", a.pixel_mm->x()) : ", pixel size unknown";
  text += a.source_detector_mm ? fmt::format(", source {:.4g} mm", *a.source_detector_mm)
                               : ", source distance unknown";
  if (a.primary_angle_deg) text += fmt::format(", {:.3g}°", *a.primary_angle_deg);
  if (a.primary_angle_deg && a.secondary_angle_deg) text += fmt::format(" {:.3g}°", *a.secondary_angle_deg);
  return text + (image.field ? ", round field" : "");
}

bool has_all_maps(const CaseDraft& draft) {
  return std::ranges::all_of(draft.images,
                             [](const CaseDraft::Image& image) { return image.plate.map.has_value(); });
}

void name_missing_parts(const CaseDraft& draft, CheckedDraft& checked) {
  if (draft.images.empty())
    checked.images_lack = "Add an image; points need two or more, of different directions.";
  else if (std::ranges::any_of(checked.images, [](const auto& image) { return image.failure.has_value(); }))
    checked.images_lack = "Remove the images that cannot be used.";
  if (draft.calibrator.empty())
    checked.calibrator_lacks =
        "Choose the calibrator that is in the images: built in, or its calibrator.json.";
  if (checked.images_lack.empty() && !draft.plate && !checked.plate.plate && !has_all_maps(draft))
    checked.plate_lacks = fmt::format(
        "The images do not decide it: {}. Choose the plate, or give each view a map.", checked.plate.why);
  if (draft.folder.empty())
    checked.folder_lacks = "Choose a folder for the case.";
  else if (fs::exists(draft.folder / "case.json"))
    checked.folder_lacks = "This folder holds a case: choose another one.";
}

}  // namespace

std::vector<pipeline::InspectedImage> DraftChecker::inspect(const CaseDraft& draft, CheckedDraft& checked) {
  std::vector<pipeline::InspectedImage> images;
  for (const CaseDraft::Image& image : draft.images) {
    CheckedDraft::Image& of_image = checked.images.emplace_back();
    if (!frames_.contains(image.file)) frames_.emplace(image.file, xray::count_frames(image.file));
    const auto& frames = frames_.at(image.file);
    if (!frames) {
      of_image.failure = frames.error();
      continue;
    }
    of_image.frames = *frames;
    if (*frames > 1) of_image.frame = std::clamp(image.frame.value_or((*frames + 1) / 2), 1, *frames);
    const Key key{image.file, of_image.frame.value_or(1)};
    if (!inspected_.contains(key))
      inspected_.emplace(key, pipeline::inspect_image({image.file, of_image.frame}));
    const auto& inspected = inspected_.at(key);
    if (!inspected) {
      of_image.failure = inspected.error();
      continue;
    }
    of_image.found = found_in(*inspected);
    images.push_back(*inspected);
    images.back().view = image.view;
  }
  std::erase_if(inspected_, [&](const auto& entry) {
    return std::ranges::none_of(images, [&](const pipeline::InspectedImage& image) {
      return entry.first == Key{image.file, image.frame.value_or(1)};
    });
  });
  pipeline::name_views(images);
  auto named = images.begin();
  for (CheckedDraft::Image& image : checked.images)
    if (!image.failure) image.view = (named++)->view;
  return images;
}

const pipeline::PlateChoice& DraftChecker::plate_by(const std::vector<pipeline::InspectedImage>& images) {
  std::vector<Key> keys;
  for (const auto& image : images) keys.emplace_back(image.file, image.frame.value_or(1));
  if (std::exchange(chosen_for_, keys) != keys) choice_ = pipeline::choose_plate(images);
  return choice_;
}

CheckedDraft DraftChecker::check(const CaseDraft& draft) {
  const std::lock_guard lock(mutex_);
  CheckedDraft checked;
  auto images = inspect(draft, checked);
  if (images.size() == draft.images.size() && !images.empty()) checked.plate = plate_by(images);
  name_missing_parts(draft, checked);
  const bool lacks = !checked.images_lack.empty() || !checked.calibrator_lacks.empty() ||
                     !checked.plate_lacks.empty() || !checked.folder_lacks.empty();
  if (lacks) return checked;
  checked.made = make(draft, checked.plate, std::move(images));
  return checked;
}

Expected<pipeline::NewCase> DraftChecker::make(const CaseDraft& draft, const pipeline::PlateChoice& choice,
                                               std::vector<pipeline::InspectedImage> images) {
  const bool is_by_images = !draft.plate && !has_all_maps(draft);
  pipeline::NewCaseOptions options{draft.calibrator, is_by_images ? choice.plate : draft.plate, {}, {}};
  for (std::size_t i = 0; i < images.size(); ++i) {
    const ViewPlate& plate = draft.images[i].plate;
    if (plate.map) options.maps.emplace_back(images[i].view, *plate.map);
    if (plate.plate_image) options.plate_images.emplace_back(images[i].view, *plate.plate_image);
  }
  return pipeline::new_case(std::move(images), options, draft.folder).map([&](pipeline::NewCase made) {
    std::string& notes = made.the_case.notes;
    for (const auto& [what, words] : {std::pair("C-arm", &draft.c_arm), {"detector", &draft.intensifier}})
      if (!words->empty()) notes += fmt::format("; {}: {}", what, *words);
    return made;
  });
}

Expected<void> DraftChecker::write(const CaseDraft& draft) {
  const std::lock_guard lock(mutex_);
  CheckedDraft checked;
  auto images = inspect(draft, checked);
  for (const CheckedDraft::Image& image : checked.images)
    if (image.failure) return tl::unexpected(*image.failure);
  const pipeline::PlateChoice& choice = plate_by(images);
  return make(draft, choice, std::move(images)).and_then([&](const pipeline::NewCase& made) {
    return pipeline::write_new_case(made, draft.folder);
  });
}

fs::path folder_beside(const fs::path& image) {
  const fs::path parent = fs::absolute(image).parent_path();
  fs::path folder = parent / "case";
  for (int n = 2; fs::exists(folder); ++n) folder = parent / fmt::format("case-{}", n);
  return folder;
}

}  // namespace helicarm::gui

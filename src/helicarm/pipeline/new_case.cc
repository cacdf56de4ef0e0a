// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/new_case.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/files.h"
#include "helicarm/core/private_files.h"
#include "helicarm/core/text.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/pipeline/stages.h"
#include "helicarm/rectification/rectify.h"
#include "helicarm/xray/read_xray_image.h"
#include "helicarm/xray/view_of.h"

namespace helicarm::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t most_copied_bytes = std::uintmax_t{512} << 20;
constexpr int least_dots_of_any_plate = 20;  // more than outliers form
constexpr double least_angle_deg = 30;       // of two views, as `views_too_close`

std::string printable(const fs::path& file) { return without_control_characters(file.filename().string()); }

/// A name as part of a file name.
std::string plain(const std::string& name) {
  std::string file = name;
  std::ranges::replace_if(
      file, [](unsigned char c) { return c < 0x80 && !std::isalnum(c) && c != '-' && c != '_' && c != '.'; },
      '_');
  return file;
}

bool lies_in(const fs::path& file, const fs::path& folder) {
  const fs::path relative = fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder));
  return !relative.empty() && *relative.begin() != ".." && relative != ".";
}

/// The file's name in case.json; it is copied unless it lies in the folder.
std::string brought(NewCase& draft, const fs::path& file, const fs::path& folder, const std::string& name) {
  if (lies_in(file, folder))
    return fs::weakly_canonical(file).lexically_relative(fs::weakly_canonical(folder)).generic_string();
  draft.copies.push_back({file, name});
  return name;
}

std::string brought_image(NewCase& draft, const fs::path& file, const fs::path& folder,
                          const std::string& name) {
  const std::string ending = file.has_extension() ? file.extension().string() : ".dcm";
  const std::string to = brought(draft, file, folder, plain(name) + ending);
  const auto sidecar = ending == ".dcm" ? xray::full_sidecar_of(file) : xray::sidecar_of(file);
  if (sidecar && !lies_in(file, folder)) draft.copies.push_back({*sidecar, to + ".json"});
  return to;
}

std::string description_of(const InspectedImage& image) {
  const xray::Acquisition& a = image.xray_image.acquisition;
  std::string text = fmt::format("{}: {}", image.view, printable(image.file));
  if (image.frame) text += fmt::format(", frame {}", *image.frame);
  text += fmt::format(", {} x {} pixels", image.xray_image.pixels.width(), image.xray_image.pixels.height());
  text += a.pixel_mm ? fmt::format(" of {:.4g} mm", a.pixel_mm->x()) : " of unknown size";
  text += a.source_detector_mm ? fmt::format(", source to detector {:.4g} mm", *a.source_detector_mm)
                               : ", source distance unknown";
  if (a.primary_angle_deg)
    text += fmt::format(", positioner {:.3g}, {:.3g} degrees", *a.primary_angle_deg,
                        a.secondary_angle_deg.value_or(0));
  return text + (image.field ? ", round field" : ", no round field");
}

const InspectedImage& image_named(const std::vector<InspectedImage>& images, const std::string& view,
                                  const char* option) {
  const auto found = std::ranges::find(images, view, &InspectedImage::view);
  if (found == images.end()) {
    std::vector<std::string> names;
    for (const InspectedImage& image : images) names.push_back(image.view);
    throw BadInput(Reason::usage, fmt::format("{}: \"{}\" is not a view; the views are {}", option, view,
                                              fmt::join(names, ", ")));
  }
  return *found;
}

void check_images(const std::vector<InspectedImage>& images) {
  if (images.empty()) throw BadInput(Reason::usage, "no image given");
  std::set<std::string> names;
  std::vector<ReadView> views;
  for (const InspectedImage& image : images) {
    if (!names.insert(image.view).second)
      throw BadInput(Reason::name_clash, fmt::format("two views are named \"{}\"", image.view));
    views.push_back({{image.view}, std::make_shared<const xray::XrayImage>(image.xray_image)});
  }
  value_or_throw(check_images_belong_together(views));
}

void warn(NewCase& draft, const std::vector<InspectedImage>& images) {
  double widest = 0;
  bool known = images.size() > 1;
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (Warning warning : images[i].xray_image.warnings) {
      warning.view = images[i].view;
      draft.warnings.push_back(std::move(warning));
    }
    for (std::size_t j = 0; j < i; ++j)
      if (const auto angle =
              xray::degrees_apart(images[i].xray_image.acquisition, images[j].xray_image.acquisition))
        widest = std::max(widest, *angle);
      else
        known = false;
  }
  if (known && widest < least_angle_deg)
    draft.warnings.push_back(
        {Reason::views_too_close,
         fmt::format("by their positioner angles the views are {:.0f} degrees apart, at least {:.0f} are "
                     "needed",
                     widest, least_angle_deg),
         {},
         {{"angle_deg", widest}}});
}

void set_calibrator(NewCase& draft, const std::string& name, const fs::path& folder) {
  if (name.empty())
    throw BadInput(Reason::usage,
                   "--calibrator is missing: give calibrator.json, or udcsc for the built-in one");
  const bool is_file = fs::is_regular_file(name);
  const phantom::Calibrator calibrator =
      value_or_throw(is_file ? phantom::read_calibrator(name) : phantom::calibrator_named(name, folder));
  draft.the_case.calibrator_name = is_file ? brought(draft, name, folder, "calibrator.json") : name;
  draft.findings.push_back(fmt::format("calibrator: {}, {} balls, {} targets",
                                       without_control_characters(calibrator.name), calibrator.balls.size(),
                                       calibrator.targets.size()));
}

void set_plate(NewCase& draft, const std::vector<InspectedImage>& images, const NewCaseOptions& options,
               const fs::path& folder) {
  PlateChoice choice{options.plate, "as given"};
  if (!choice.plate && options.maps.size() == images.size()) choice = {"none", "every view has a map"};
  if (!choice.plate && !options.plate_images.empty())
    throw BadInput(Reason::usage,
                   "--plate is missing: --plate-image needs the file of its plate, plate.json or plate48");
  if (!choice.plate) choice = choose_plate(images);
  if (!choice.plate)
    throw BadInput(
        Reason::usage,
        fmt::format("--plate is missing: {}; give plate.json or plate48, an image of the plate with "
                    "--plate-image, a map with --map, or --plate none if the images are free of "
                    "distortion",
                    choice.why));
  draft.findings.push_back(fmt::format("plate: {} ({})", printable(*choice.plate), choice.why));
  if (*choice.plate == "none") return;
  const bool is_file = fs::is_regular_file(*choice.plate);
  value_or_throw(is_file ? phantom::read_plate(*choice.plate) : phantom::plate_named(*choice.plate, folder));
  draft.the_case.plate_name = is_file ? brought(draft, *choice.plate, folder, "plate.json") : *choice.plate;
}

void set_views(NewCase& draft, const std::vector<InspectedImage>& images, const NewCaseOptions& options,
               const fs::path& folder) {
  for (const InspectedImage& image : images) {
    CaseView& view = draft.the_case.views.emplace_back();
    view.name = image.view;
    view.image = folder / brought_image(draft, image.file, folder, image.view);
    view.frame = image.frame;
    view.pixel_mm = options.stated.pixel_mm;
    view.source_detector_mm = options.stated.source_detector_mm;
    for (const auto& [name, angles] : options.angles_deg)
      if (name == image.view) view.primary_deg = angles[0], view.secondary_deg = angles[1];
    for (const auto& [name, file] : options.plate_images)
      if (name == image.view)
        view.plate_image = folder / brought_image(draft, file, folder, image.view + "_plate");
    for (const auto& [name, file] : options.maps)
      if (name == image.view) view.map = folder / brought(draft, file, folder, plain(name) + "_map.json");
  }
  for (const auto& [name, file] : options.plate_images) image_named(images, name, "--plate-image");
  for (const auto& [name, file] : options.maps) image_named(images, name, "--map");
}

}  // namespace

NewImage new_image_from(const std::string& word) {
  NewImage image{word};
  const auto exists = [&] { return fs::exists(image.file); };
  if (exists()) return image;
  std::string rest = word;
  if (const std::size_t equals = rest.find('='); equals != rest.npos && equals > 0) {
    image.view = rest.substr(0, equals);
    image.file = rest = rest.substr(equals + 1);
    if (exists()) return image;
  }
  const std::size_t colon = rest.rfind(':');
  if (colon == rest.npos || colon + 1 == rest.size() || rest.size() - colon > 7 ||
      !std::all_of(rest.begin() + std::ptrdiff_t(colon) + 1, rest.end(),
                   [](unsigned char c) { return std::isdigit(c); }))
    return image;
  image.frame = std::stoi(rest.substr(colon + 1));
  image.file = rest.substr(0, colon);
  return image;
}

Expected<InspectedImage> inspect_image(const NewImage& image) {
  return guarded([&] {
    if (fs::is_directory(image.file))
      throw BadInput(
          Reason::missing_file,
          fmt::format("{}: is a folder: name its images, each as [VIEW=]FILE[:FRAME]", image.file.string()));
    if (!image.frame)
      if (const int frames = value_or_throw(xray::count_frames(image.file)); frames > 1)
        throw BadInput({Reason::usage,
                        fmt::format("{} holds {} frames: name one, for example {}:{}", printable(image.file),
                                    frames, printable(image.file), (frames + 1) / 2),
                        {},
                        {{"frames", double(frames)}}});
    InspectedImage inspected{
        image, value_or_throw(xray::read_xray_image(image.file, image.view, image.frame)), {}};
    inspected.field = rectification::round_field(inspected.xray_image);
    return inspected;
  });
}

void name_views(std::vector<InspectedImage>& images) {
  std::set<std::pair<double, double>> angles;
  for (const InspectedImage& image : images) {
    const xray::Acquisition& a = image.xray_image.acquisition;
    if (a.primary_angle_deg) angles.emplace(*a.primary_angle_deg, a.secondary_angle_deg.value_or(0));
  }
  std::set<std::string> taken;
  for (const InspectedImage& image : images) taken.insert(image.view);
  for (InspectedImage& image : images) {
    if (!image.view.empty()) continue;
    // Many C-arms write the same angles into every image: only differing ones count.
    std::optional<std::string> kind;
    if (angles.size() > 1) kind = xray::kind_of_view(image.xray_image.acquisition);
    std::string base = kind ? *kind : printable(image.file.stem()).substr(0, 90);
    if (base.empty()) base = "view";
    image.view = base;
    for (int n = 2; taken.count(image.view); ++n) image.view = fmt::format("{}_{}", base, n);
    taken.insert(image.view);
  }
}

PlateChoice choose_plate(const std::vector<InspectedImage>& images) {
  const phantom::Plate built_in = phantom::plate48();
  std::vector<detection::ImageDots> searched;
  for (const InspectedImage& image : images)
    searched.push_back(detection::unsearched(image.xray_image,
                                             rectification::least_dot_radius_px(image.xray_image, built_in)));
  const auto dots_of = [&](std::size_t i, const phantom::Plate& plate) {
    const auto found = rectification::rectify(images[i].xray_image, searched[i], plate, {});
    return found ? found->dots_found : 0;
  };
  std::vector<int> dots;
  for (std::size_t i = 0; i < images.size(); ++i) dots.push_back(dots_of(i, built_in));
  if (std::ranges::min(dots) > 0)
    return {built_in.name, fmt::format("its dots are found in every image: {}", fmt::join(dots, ", "))};
  const auto round =
      std::ranges::find_if(images, [](const InspectedImage& i) { return i.field.has_value(); });
  if (round == images.end() && std::ranges::max(dots) == 0)
    return {"none", "no lattice of dots and no round field: a flat panel"};
  using phantom::Lattice;
  for (const auto& [lattice, word] :
       {std::pair{Lattice::square, "square"}, {Lattice::hexagonal, "hexagonal"}}) {
    const phantom::Plate any{"any plate", phantom::DotKind::balls, lattice, {}, built_in.diameter_mm, {}, {}};
    for (std::size_t i = 0; i < images.size(); ++i)
      if (const int found = dots_of(i, any); found >= least_dots_of_any_plate)
        return {{},
                fmt::format("{} shows a {} lattice of {} dots, which is not that of {}", images[i].view, word,
                            found, built_in.name)};
  }
  return {{},
          fmt::format("the round field of {} is that of an image intensifier, and no plate is found in it",
                      round == images.end() ? images.front().view : round->view)};
}

Expected<NewCase> new_case(std::vector<InspectedImage> images, const NewCaseOptions& options,
                           const fs::path& folder) {
  return guarded([&] {
    name_views(images);
    for (InspectedImage& image : images) {
      xray::StatedGeometry stated = options.stated;
      for (const auto& [name, angles] : options.angles_deg)
        if (name == image.view) stated.primary_deg = angles[0], stated.secondary_deg = angles[1];
      value_or_throw(xray::state_geometry(image.xray_image, stated, image.view));
    }
    for (const auto& [name, angles] : options.angles_deg) {
      image_named(images, name, "--angles");
      for (const double deg : angles)
        if (!(std::abs(deg) <= 360))
          throw BadInput(Reason::bad_value,
                         fmt::format("--angles: {} is {:g} degrees, limits -360 and 360", name, deg));
    }
    check_images(images);
    NewCase draft;
    for (const InspectedImage& image : images) draft.findings.push_back(description_of(image));
    draft.the_case.folder = folder;
    set_calibrator(draft, options.calibrator, folder);
    set_plate(draft, images, options, folder);
    set_views(draft, images, options, folder);
    draft.the_case.notes = fmt::format("{}", fmt::join(draft.findings, "; "));
    warn(draft, images);
    return draft;
  });
}

Expected<void> write_new_case(const NewCase& draft, const fs::path& folder) {
  return guarded([&] {
    if (fs::exists(folder / "case.json"))
      throw BadInput(Reason::cannot_write,
                     fmt::format("{} holds a case.json: choose another folder", folder.string()));
    for (const NewCase::Copy& copy : draft.copies) {
      if (fs::exists(folder / copy.to))
        throw BadInput(Reason::cannot_write,
                       fmt::format("{} exists: choose another folder", (folder / copy.to).string()));
      value_or_throw(make_private_folder((folder / copy.to).parent_path()));
      value_or_throw(
          write_private_file(folder / copy.to, value_or_throw(read_file(copy.from, most_copied_bytes))));
    }
    value_or_throw(make_private_folder(folder));
    value_or_throw(write_private_file(folder / "case.json", to_text(to_json(draft.the_case)) + "\n"));
    value_or_throw(read_case(folder));
  });
}

}  // namespace helicarm::pipeline

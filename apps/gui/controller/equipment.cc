// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/equipment.h"

#include <algorithm>
#include <thread>

#include <fmt/format.h>

#include "helicarm/case_registration/camera_case.h"
#include "helicarm/pipeline/new_case.h"
#include "helicarm/xray/read_xray_image.h"

namespace helicarm::gui {
namespace {

constexpr int most_entries = 3;
constexpr double image_patience_s = 20, image_glance_s = 0.1;
/// The pose window of an acquisition is the 1.5 s before an image's arrival.
constexpr std::chrono::milliseconds before_exposure{1800};

}  // namespace

void NewestGuidance::set(std::optional<operation::Guidance> guidance) {
  const std::lock_guard lock(mutex_);
  newest_ = std::move(guidance);
  set_s_ = tracker::monotonic_seconds();
}

std::optional<operation::Guidance> NewestGuidance::at(double now_s) const {
  constexpr double longest_s = 0.5;  // five decisions
  const std::lock_guard lock(mutex_);
  if (!newest_ || now_s - set_s_ <= longest_s) return newest_;
  operation::Guidance late;
  late.why_not = Failure{Reason::stale_pose,
                         fmt::format("no decision for {:.1f} s: the computer is busy", now_s - set_s_)};
  return late;
}

MeasuredImages measured_images(const operation::Operation& operation) {
  return {operation.images(), operation.is_measured() || operation.newest_result().has_value()};
}

Expected<Images> images_of(const operation::Operation& operation) {
  return guarded([&] {
    const auto taken = operation.images();
    Images images;
    for (const std::string& name : operation.plan().views) {
      pipeline::ViewResult shown;
      shown.name = name;
      if (const auto file = taken.find(name); file != taken.end())
        shown.xray_image = std::make_shared<const xray::XrayImage>(
            value_or_throw(xray::read_xray_image(file->second, name, 1)));
      images.push_back(std::move(shown));
    }
    return images;
  });
}

std::shared_ptr<const pipeline::Result> result_with(Images images) {
  auto result = std::make_shared<pipeline::Result>();
  result->views = std::move(images);
  return result;
}

Expected<Images> take(Equipment& equipment, const std::string& view,
                      const operation::DatedArrival& view_image) {
  return equipment.operation->take(view, view_image.arrival, view_image.time_s).and_then([&] {
    return images_of(*equipment.operation);
  });
}

namespace {

std::optional<operation::DatedArrival> wait_for_image(Equipment& equipment) {
  for (int glance = 0; glance * image_glance_s < image_patience_s && !equipment.stopped; ++glance)
    if (auto view_image = equipment.devices->next_image(image_glance_s)) return view_image;
  return std::nullopt;
}

}  // namespace

Expected<Images> shoot_and_take(Equipment& equipment, const std::string& view) {
  const virtual_devices::ImageReceiver receiver{"127.0.0.1", equipment.devices->receiver_port()};
  Expected<Images> taken = fail(Reason::not_connected, "no image received");
  for (int acquired_view = 0; acquired_view < most_entries && !taken && !equipment.stopped; ++acquired_view) {
    std::this_thread::sleep_for(before_exposure);
    const auto sent = virtual_devices::shoot(equipment.virtual_or->simulated_scene(), view, receiver,
                                             equipment.c_arm_fault);
    if (!sent) return tl::unexpected<Failure>(sent.error());
    if (const auto view_image = wait_for_image(equipment)) taken = take(equipment, view, *view_image);
  }
  if (!taken && equipment.stopped) return fail(Reason::interrupted, "cancelled");
  return taken;
}

namespace {

/// The case with other picks; without the tunnels that have lost an end, and their tool lines.
pipeline::Case with_picks(pipeline::Case the_case, const std::vector<pipeline::Pick>& picks) {
  the_case.picks = picks;
  const auto is_picked = [&](const std::string& point) {
    return std::ranges::find(picks, point, &pipeline::Pick::name) != picks.end();
  };
  std::erase_if(the_case.tunnels, [&](const pipeline::CaseTunnel& tunnel) {
    return !is_picked(tunnel.start) || !is_picked(tunnel.end);
  });
  std::erase_if(the_case.tool_lines, [&](const auto& line) {
    return std::ranges::find(the_case.tunnels, line.tunnel, &pipeline::CaseTunnel::name) ==
           the_case.tunnels.end();
  });
  return the_case;
}

}  // namespace

Expected<pipeline::Result> measure(Equipment& equipment, const std::vector<pipeline::Pick>& picks) {
  if (equipment.the_case) {
    const pipeline::Case picked = with_picks(*equipment.the_case, picks);
    auto measured =
        pipeline::brings_cameras(picked)
            ? case_registration::measure_with_cameras(equipment.measurement, picked, equipment.options.run)
            : pipeline::measure_again(equipment.measurement, picked, equipment.options.run);
    if (!measured) return tl::unexpected<Failure>(measured.error());
    equipment.measurement = *std::move(measured);
    return *equipment.measurement;
  }
  equipment.operation->pick(picks);
  const auto done = equipment.operation->measure();
  if (const auto& result = equipment.operation->newest_result()) return *result;
  return tl::unexpected<Failure>(done.error());
}

namespace {

Expected<std::pair<ViewFile, pipeline::InspectedImage>> middle_frame(const std::filesystem::path& file) {
  return xray::count_frames(file).and_then([&](int frames) {
    const int middle = (frames + 1) / 2;
    return pipeline::inspect_image({file, frames > 1 ? std::optional(middle) : std::nullopt})
        .map([&](pipeline::InspectedImage image) {
          return std::pair(ViewFile{file, frames, middle}, std::move(image));
        });
  });
}

}  // namespace

Expected<LooseImages> read_loose_images(const std::vector<std::filesystem::path>& files) {
  if (files.size() > most_loose_images)
    return fail(Reason::usage, fmt::format("{} files given, at most {} are opened together", files.size(),
                                           most_loose_images));
  LooseImages loose;
  std::vector<pipeline::InspectedImage> read;
  for (const std::filesystem::path& file : files) {
    auto image = middle_frame(file);
    if (image) {
      loose.files.push_back(std::move(image->first));
      read.push_back(std::move(image->second));
    } else if (!loose.unreadable) {
      loose.unreadable = image.error();
    }
  }
  if (read.empty() && loose.unreadable) return tl::unexpected<Failure>(*loose.unreadable);
  pipeline::name_views(read);
  for (pipeline::InspectedImage& image : read) {
    pipeline::ViewResult view;
    view.name = image.xray_image.name = image.view;
    view.xray_image = std::make_shared<const xray::XrayImage>(std::move(image.xray_image));
    loose.images.push_back(std::move(view));
  }
  return loose;
}

std::vector<ViewFile> files_of(const pipeline::Case& the_case) {
  std::vector<ViewFile> files;
  for (const pipeline::CaseView& view : the_case.views)
    files.push_back({view.image, xray::count_frames(view.image).value_or(1), view.frame.value_or(1)});
  return files;
}

}  // namespace helicarm::gui

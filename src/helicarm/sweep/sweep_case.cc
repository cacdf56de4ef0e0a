// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/sweep_case.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/case_registration/follow_case.h"
#include "helicarm/core/number_ranges.h"
#include "helicarm/pipeline/case_frames.h"

namespace helicarm::sweep {
namespace {

namespace fs = std::filesystem;
using case_registration::FrameRange;

pipeline::CaseView numbered(const pipeline::CaseView& view, int number) {
  return value_or_throw(pipeline::at_number(view, number));
}

constexpr int most_number = 999999;

/// Numbers of the files that exist.
std::vector<int> numbers_of_files(const pipeline::CaseView& view) {
  std::vector<int> numbers;
  const std::string pattern = view.image.filename().string();
  const std::size_t prefix = pattern.find("{frame");
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(view.image.parent_path(), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.size() <= prefix || name.compare(0, prefix, pattern, 0, prefix) != 0) continue;
    const std::size_t last = std::min(name.find_first_not_of("0123456789", prefix), name.size());
    constexpr std::size_t most_digits = 9;
    if (last == prefix || last - prefix > most_digits) continue;
    const int number = std::stoi(name.substr(prefix, last - prefix));
    if (number <= most_number && numbered(view, number).image.filename() == name) numbers.push_back(number);
  }
  if (numbers.empty())
    throw BadInput(Reason::missing_file, fmt::format("{}: no file \"{}\" in {}", view.name, pattern,
                                                     view.image.parent_path().string()));
  std::ranges::sort(numbers);
  return numbers;
}

/// Warns of numbers without a file between the first and the last, if all others have one step.
void warn_of_gaps(const std::vector<int>& numbers, const std::string& view, std::vector<Warning>& warnings) {
  if (numbers.size() < 3) return;
  int step = numbers.back() - numbers.front();
  for (std::size_t i = 1; i < numbers.size(); ++i) step = std::min(step, numbers[i] - numbers[i - 1]);
  std::vector<int> gaps;
  for (std::size_t i = 1; i < numbers.size(); ++i)
    for (int number = numbers[i - 1] + step; number < numbers[i]; number += step) gaps.push_back(number);
  if (gaps.empty()) return;
  warnings.push_back({Reason::frames_missing,
                      fmt::format("{} of {} numbers of the run have no image: {}", gaps.size(),
                                  gaps.size() + numbers.size(), number_ranges(gaps)),
                      view,
                      {{"missing", double(gaps.size())}, {"images", double(numbers.size())}}});
}

std::vector<int> numbers_of(SweepCase& read, const pipeline::CaseView& view, const std::string& frames) {
  const bool all = frames == "all";
  if (pipeline::is_numbered(view))
    return all ? numbers_of_files(view)
               : value_or_throw(case_registration::frame_range_from(frames)).numbers();
  auto& file = read.files[view.image];
  if (!file) file = value_or_throw(xray::ImageFile::open(view.image));
  value_or_throw(file->check_angles());
  const int count = file->frames();
  const FrameRange range =
      all ? FrameRange{1, count, 1} : value_or_throw(case_registration::frame_range_from(frames));
  if (range.first < 1 || range.last > count)
    throw BadInput(Reason::bad_value, fmt::format("{}: \"frames\" is \"{}\", but {} has the frames 1 to {}",
                                                  view.name, frames, view.image.filename().string(), count));
  return range.numbers();
}

void add_frames(SweepCase& read, pipeline::CaseView view) {
  const std::string frames = view.frames.value_or("");
  if (!view.frames) {
    read.frames.push_back({view, view.name, view.frame.value_or(1)});
    return;
  }
  view.frames.reset();  // each frame is a view like any other
  std::string first;
  std::vector<int> missing;
  const std::vector<int> numbers = numbers_of(read, view, frames);
  if (frames == "all" && pipeline::is_numbered(view)) warn_of_gaps(numbers, view.name, read.base.warnings);
  if (read.frames.size() + numbers.size() > pipeline::most_frames)
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: more than {} images in the case", view.name, pipeline::most_frames));
  for (const int number : numbers) {
    Frame frame{numbered(view, number), view.name, number};
    frame.view.name = fmt::format("{}/{}", view.name, number);
    if (!fs::exists(frame.view.image)) {
      if (missing.empty()) first = frame.view.image.filename().string();
      missing.push_back(number);
    }
    read.frames.push_back(std::move(frame));
  }
  if (!missing.empty())
    throw BadInput(
        Reason::missing_file,
        fmt::format(
            "{}: {} of {} images do not exist, the first: {}; the frames {}. \"frames\": \"all\" takes "
            "those that exist",
            view.name, missing.size(), numbers.size(), first, number_ranges(missing)));
}

Expected<SweepCase> read_runs(const fs::path& path, pipeline::Purpose purpose) {
  return guarded([&] {
    SweepCase read{value_or_throw(pipeline::read_case(path, purpose)), {}, {}};
    for (const pipeline::CaseView& view : read.base.views) add_frames(read, view);
    return read;
  });
}

}  // namespace

Expected<SweepCase> read_sweep_case(const fs::path& path) {
  return read_runs(path, pipeline::Purpose::sweep);
}

void take_maps(SweepCase& the_case, const calibration::CArmHistory& record) {
  if (auto maps = calibration::c_arm_maps(record.entries))
    the_case.maps = std::make_shared<const calibration::CArmMaps>(*std::move(maps));
}

Expected<pipeline::Case> read_phantom_case(const fs::path& path) {
  return read_runs(path, pipeline::Purpose::phantom).map([](SweepCase read) {
    read.base.views.clear();
    for (Frame& frame : read.frames) read.base.views.push_back(std::move(frame.view));
    return std::move(read.base);
  });
}

}  // namespace helicarm::sweep

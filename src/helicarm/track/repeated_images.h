// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/track/image_keys.h"

namespace helicarm::track {

/// An image with the pixels of another one: of a frozen or duplicated frame, or of another view's file. It
/// says nothing of its own moment.
struct RepeatedImage {
  std::size_t view;
  int of_frame;
  std::size_t of_view;

  /// cameras_not_in_step for an earlier image of the view, else views_too_close.
  Reason reason() const { return of_view == view ? Reason::cameras_not_in_step : Reason::views_too_close; }
};

/// The images of a sequence so far.
class RepeatedImages {
 public:
  /// Those of the next frame that are an earlier frame's, or those of two views of it that are the same.
  /// Images of one grey value, which show nothing, are none of them.
  std::vector<RepeatedImage> among(int frame, const std::vector<xray::XrayImage>& images);

 private:
  struct From {
    int frame;
    std::size_t view;
  };
  std::map<std::string, From> seen_;
};

/// Refuses (views_too_close) a first frame in which two views are the same image.
void check_views_differ(const std::vector<std::string>& views, int frame,
                        const std::vector<RepeatedImage>& repeated);

/// What a frame lacks: nothing where two views or more have an image of its moment.
std::optional<RepeatedImage> too_many_repeated(const std::vector<RepeatedImage>& repeated, std::size_t views);

/// "frame 7: the image of cam2 is that of its frame 6 again".
std::string repeated_text(const std::vector<std::string>& views, int frame, const RepeatedImage& repeated);

/// `of_frames`: [frame]. One for each view and the view whose images it repeats.
std::vector<Warning> warnings_of_repeated(const std::vector<std::string>& views,
                                          const std::vector<int>& frames,
                                          const std::vector<std::vector<RepeatedImage>>& of_frames);

}  // namespace helicarm::track

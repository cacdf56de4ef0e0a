// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/codec.h"
#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/poses_json.h"
#include "helicarm/xray/dicom_acquisition.h"

/// The keys of a view in case.json, once for reader, writer and schema.
namespace helicarm::pipeline::description {

inline constexpr int most_number = 1000000;  // of an image

inline bool has_reading(const guidance::Poses& poses) {
  return poses.tracker_from_calibrator || poses.tracker_from_tool || !poses.tracker_from_bone.empty();
}

template <class Codec, class Poses>
void describe_poses(Codec& codec, const char* key, Poses& poses, const std::vector<guidance::Bone>& bones,
                    OtherMarker other, const char* help) {
  codec.custom(
      key, false, {{"type", "object"}}, help,
      [&](JsonReader& reader) {
        if constexpr (!std::is_const_v<Poses>)
          if (!reader.raw(key).is_null()) poses = poses_from(reader.object(key), bones, other);
      },
      [&] { return has_reading(poses) ? std::optional(to_json(poses, other)) : std::nullopt; });
}

inline constexpr const char* of_track =
    "makes the case a sequence of markers: follow them with `helicarm track CASE --frames A-B`";

/// Refuses a key that belongs to other purposes.
template <class Codec>
void check_purpose(Codec& codec, const char* key, bool belongs, const char* refusal) {
  codec.check([&](JsonReader& reader) {
    if (!belongs && reader.has(key)) reader.refuse(Reason::bad_value, key, refusal);
  });
}

template <class Codec>
void check_track(Codec& codec, const char* key, Purpose purpose) {
  check_purpose(codec, key, purpose == Purpose::track, of_track);
}

template <class Codec, class View>
void describe_images(Codec& codec, View& view, const std::filesystem::path& folder, Purpose purpose) {
  codec.text("name", view.name, "unique");
  codec.file("image", view.image, folder, "path of an [image file](#images-and-sidecars)");
  codec.integer("frame", view.frame, 1, 100000, "1-based; needed only if the file has several frames");
  check_purpose(codec, "camera", purpose == Purpose::registration || purpose == Purpose::track,
                "is for `helicarm register`, which uses cameras of other programs; here each view is "
                "calibrated");
  codec.file(
      "camera", view.camera, folder,
      "of `helicarm register` and `helicarm track`: path of a [camera of another "
      "program](#projections-of-other-programs), for all views or for none; the image is taken as free of "
      "distortion, or `map` leads to the camera's pixels. Then `calibrator` and `plate` may be left out, and "
      "the world is the cameras'");
  check_track(codec, "calibration", purpose);
  codec.file("calibration", view.calibration, folder,
             "of [`helicarm track`](motion.md#run-it): path of a result.json that holds this view's camera");
  codec.check([&](JsonReader& reader) {
    if (view.camera && view.calibration)
      reader.refuse(Reason::bad_value, "calibration", "cannot be combined with \"camera\"");
  });
  check_purpose(codec, "frame_offset", purpose == Purpose::registration || purpose == Purpose::track,
                of_track);
  codec.integer("frame_offset", view.frame_offset, -most_number, most_number,
                "of `helicarm track` and `helicarm register --frames`: the image's number is the "
                "sequence's frame plus this");
  check_purpose(
      codec, "frames", purpose == Purpose::sweep || purpose == Purpose::phantom,
      "makes the view a run of images: calibrate it with `helicarm sweep`, or name one image by \"frame\"");
  codec.text(
      "frames", view.frames,
      "of `helicarm sweep` and `phantom measure`: `\"all\"` or `\"A-B[:STEP]\"`, frames of the file or of "
      "numbered files (`{frame}` or `{frame:04d}` in `image`); each is a view `NAME/12`, up to 1000");
  codec.check([&](JsonReader& reader) {
    if (view.frames && view.frame)
      reader.refuse(Reason::bad_value, "frame", "cannot be combined with \"frames\"");
  });
}

template <class Codec, class View>
void describe_view(Codec& codec, View& view, const std::filesystem::path& folder,
                   const std::vector<guidance::Bone>& bones, Purpose purpose) {
  describe_images(codec, view, folder, purpose);
  codec.file("plate_image", view.plate_image, folder,
             "image of the plate alone, acquired in the same C-arm position; needs a `plate`");
  codec.file("map", view.map, folder, "path of a [map.json](#mapjson); not beside `plate_image`");
  codec.check([&](JsonReader& reader) {
    if (view.plate_image && view.map)
      reader.refuse(Reason::bad_value, "map", "cannot be combined with \"plate_image\"");
  });
  codec.boolean(
      "mirrored", view.mirrored,
      "whether the C-arm stores mirrored images, if it is known: only labellings of that handedness are "
      "tried. Absent: both");
  codec.number(
      "pixel_mm", view.pixel_mm, {xray::min_pixel_mm, xray::max_pixel_mm},
      "pixel size in the receiver's plane of an image whose file does not state it; what the file or its "
      "sidecar states must agree within 1 %. It holds for the `plate_image` too");
  codec.number("source_detector_mm", view.source_detector_mm,
               {xray::min_source_detector_mm, xray::max_source_detector_mm},
               "distance of source and receiver, likewise");
  codec.number("primary_deg", view.primary_deg, {-360, 360},
               "positioner angle, as DICOM counts it, of an image whose file does not state it, with "
               "`secondary_deg`; what the file states must agree within 1 degree");
  codec.number("secondary_deg", view.secondary_deg, {-360, 360}, "likewise, 0 where it is not tilted");
  codec.check([&](JsonReader& reader) {
    if (view.primary_deg.has_value() != view.secondary_deg.has_value())
      reader.refuse(Reason::bad_value, view.primary_deg ? "secondary_deg" : "primary_deg",
                    "is missing: the positioner's angles are stated together, 0 where it is not tilted");
    if (view.primary_deg && view.frames)
      reader.refuse(Reason::bad_value, "primary_deg",
                    "cannot be combined with \"frames\": the images of a run have angles of their own");
  });
  describe_poses(
      codec, "poses", view.poses, bones, OtherMarker::calibrator,
      "at the acquisition: `tracker_from_calibrator`, `tracker_from_bone` (`{\"L4\": pose, ...}`). A "
      "calibrator on the receiver turns with the C-arm and has another pose in each view; picks then state "
      "`moves_with`");
}

}  // namespace helicarm::pipeline::description

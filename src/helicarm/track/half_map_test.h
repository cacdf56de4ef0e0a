// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "helicarm/rectification/distortion_map.h"

namespace helicarm::track {

/// No distortion up to a column, and no rectified place beyond it.
class HalfModel : public rectification::DistortionModel {
 public:
  explicit HalfModel(double last) : last_(last) {}
  std::string name() const override { return "half"; }
  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const override { return rectified; }
  Eigen::Matrix2d jacobian(const Eigen::Vector2d&) const override { return Eigen::Matrix2d::Identity(); }
  double extent_px() const override { return last_; }
  std::optional<Eigen::Vector2d> rectified_from_raw(const Eigen::Vector2d& raw) const override {
    return raw.x() <= last_ ? std::optional(raw) : std::nullopt;
  }
  void write(Json& json) const override { json["last"] = last_; }

 private:
  double last_;
};

inline rectification::DistortionMap half_map(double last, int size) {
  rectification::DistortionMap map;
  map.model = std::make_shared<HalfModel>(last);
  map.hull_high = {last, size - 1.0};
  map.width = map.height = size;
  return map;
}

}  // namespace helicarm::track

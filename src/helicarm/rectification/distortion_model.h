// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/json.h"

namespace helicarm::rectification {

/// Distortion of an image: rectified (x, y) -> raw (u, v), px (Eq. 1). Does not change after construction.
class DistortionModel {
 public:
  virtual ~DistortionModel() = default;

  /// For people, e.g. "polynomial of order 3".
  virtual std::string name() const = 0;
  virtual bool is_identity() const { return false; }
  virtual Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const = 0;
  /// d raw / d rectified.
  virtual Eigen::Matrix2d jacobian(const Eigen::Vector2d& rectified) const = 0;
  /// Half the width of the area that the model was fitted to, px.
  virtual double extent_px() const = 0;
  /// Newton's method on the two functions above; nothing if it does not converge (far outside the dots).
  virtual std::optional<Eigen::Vector2d> rectified_from_raw(const Eigen::Vector2d& raw) const;
  /// Covariance per axis of raw_from_rectified among points (n x n, px^2); 0: the model is taken as exact.
  virtual Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> rectified) const;
  /// Adds the model's keys to map.json: "kind", the name in `model_kinds`, and what its `read` needs.
  virtual void write(Json& json) const = 0;
};

using ModelPointer = std::shared_ptr<const DistortionModel>;

/// Normalised position: t = (p - centre) / scale.
struct Normalisation {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double scale = 1;
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const { return (p - centre) / scale; }
};

/// Dots of a plate, to which a model is fitted.
struct PlateDots {
  Normalisation normalised;
  Eigen::Vector2d image_centre;         ///< normalised
  std::vector<Eigen::Vector2d> points;  ///< rectified, normalised
  Eigen::MatrixX2d raw;                 ///< n x 2, px
  Eigen::VectorXd weights;              ///< relative, mean 1
  double variance = 0;                  ///< of a dot of weight one according to its own sigma, px^2
};

struct ModelFit {
  ModelPointer model;        ///< null: the dots do not determine it
  Eigen::VectorXd held_out;  ///< distance of each dot from its prediction by all others, px
  double held_out_rms = std::numeric_limits<double>::infinity();  ///< of these, weighted
};

/// One kind of distortion model; `model_kinds` in distortion_model.cc lists all.
struct ModelKind {
  std::string_view name;
  /// Without a chosen model, those with the largest number not above the number of dots are compared by their
  /// held-out errors. `never`: only where it is chosen.
  Eigen::Index automatic_from_dots;
  /// `order`: of the polynomial, where the model has one; nothing: chosen by held-out error.
  ModelFit (*fit)(const PlateDots& dots, std::optional<int> order);
  /// What `write` wrote. Throws BadInput.
  ModelPointer (*read)(JsonReader& reader);

  static constexpr Eigen::Index never = std::numeric_limits<Eigen::Index>::max();
};

std::span<const ModelKind> model_kinds();
/// Null if there is none of this name.
const ModelKind* model_kind(std::string_view name);
/// Names for a message or help: "kriging, polynomial, ...".
std::string model_names();

/// The simplest model whose held-out error no other undercuts by 2 %.
ModelFit automatic_fit(const PlateDots& dots);
bool clearly_better(const ModelFit& fit, const ModelFit& than);

/// The map of a flat panel.
ModelPointer identity_model();

}  // namespace helicarm::rectification

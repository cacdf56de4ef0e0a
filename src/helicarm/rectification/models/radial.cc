// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/models/linear_model.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

constexpr Eigen::Index term_number = 5;

/// 1, x, y and the two components of |d|^2 d, with d the distance from the axis.
Eigen::VectorXd basis_at(const Vector2d& t, const Vector2d& axis) {
  const Vector2d d = t - axis;
  return (Eigen::VectorXd(term_number) << 1, t, d.squaredNorm() * d).finished();
}

/// An affine map and an odd cubic about the image centre, where an intensifier's axis lies: pincushion and S
/// distortion by 10 parameters instead of a cubic's 20, for plates of which few dots are
/// seen.
class RadialModel : public LinearModel {
 public:
  RadialModel(const Vector2d& axis, LinearTerms terms) : LinearModel(std::move(terms)), axis_(axis) {}

  std::string name() const override { return "radial"; }
  void write(Json& json) const override {
    json["kind"] = "radial";
    json["axis"] = {axis_.x(), axis_.y()};
    write_coefficients(terms().normalised, terms().coefficients, json);
    json["covariance"] = rows_of(terms().covariance);
  }

 protected:
  Eigen::VectorXd basis(const Vector2d& t) const override { return basis_at(t, axis_); }
  Eigen::MatrixX2d slopes(const Vector2d& t) const override {
    const Vector2d d = t - axis_;
    Eigen::MatrixX2d slopes(term_number, 2);
    slopes << Eigen::RowVector2d::Zero(), Eigen::Matrix2d::Identity(),
        d.squaredNorm() * Eigen::Matrix2d::Identity() + 2 * d * d.transpose();
    return slopes;
  }

 private:
  Vector2d axis_;  ///< normalised
};

ModelFit radial_fit(const PlateDots& dots, std::optional<int>) {
  if (dots.raw.rows() < 2 * term_number) return {};
  const LinearFit fit =
      fit_linear(dots, rows_for(dots, [&](const Vector2d& t) { return basis_at(t, dots.image_centre); }));
  if (fit.coefficients.size() == 0) return {};
  return {std::make_shared<RadialModel>(dots.image_centre, terms_of(fit, dots.normalised)), fit.held_out,
          fit.held_out_rms};
}

ModelPointer read(JsonReader& reader) {
  const auto axis = reader.numbers("axis", 2, {-1e3, 1e3});
  LinearTerms terms = read_coefficients(reader);
  if (terms.coefficients.rows() != term_number)
    reader.refuse(Reason::bad_value, "coefficients", "must have 5 rows");
  terms.covariance = read_covariance(reader, term_number);
  return std::make_shared<RadialModel>(Vector2d(axis[0], axis[1]), std::move(terms));
}

}  // namespace

ModelKind radial_kind() { return {"radial", 0, radial_fit, read}; }

}  // namespace helicarm::rectification

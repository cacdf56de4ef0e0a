// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/rectification/distortion_map.h"

namespace helicarm::rectification {

/// Order of the polynomials that the errors of a map through a field are made of.
inline constexpr int field_order = 5;

/// Where maps of one intensifier are compared: places over their common field, and polynomials of mean square
/// 1 over it, by degree.
struct MapField {
  std::vector<Eigen::Vector2d> places;  ///< rectified px
  Normalisation normalised;
  Eigen::MatrixXd from_monomials;  ///< terms x terms: polynomials = from_monomials * monomials(t)

  /// Values of the polynomials at the places, places x terms.
  Eigen::MatrixXd polynomials() const;
};

/// Of the box that holds all maps' dots, the places within `radius_px` of its centre (a round field; half its
/// diagonal: all).
MapField field_of(std::span<const DistortionMap> maps, double radius_px);

/// Degree of each polynomial of a field.
std::vector<int> polynomial_degrees();

/// Raw less rectified positions at the field's places, places x 2, px.
Eigen::MatrixX2d displacements(const DistortionMap& map, const MapField& field);

/// Errors of a map that is made of others.
struct MapVariation {
  std::array<double, field_order + 1> variance_px2{};  ///< of a polynomial of this degree, per axis
  double rest_px2 = 0;                                 ///< of what no polynomial holds, per axis
};

/// The map of these displacements at the field's places, with errors of the variation times `factor`: a
/// kriging model, as map.json holds. Size, plane and hull are those of `like`.
DistortionMap map_through(const MapField& field, const Eigen::MatrixX2d& displacements,
                          const MapVariation& variation, double factor, const DistortionMap& like);

/// The map without its covariance, of which a record of many would be large.
DistortionMap without_covariance(const DistortionMap& map);

}  // namespace helicarm::rectification

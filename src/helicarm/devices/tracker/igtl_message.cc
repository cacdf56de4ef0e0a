// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_message.h"

#include <cmath>

#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

constexpr double unit_tolerance = 1e-3;  // as for matrices

struct TypeName {
  std::string operator()(const IgtlTransform&) const { return "TRANSFORM"; }
  std::string operator()(const IgtlTracking&) const { return "TDATA"; }
  std::string operator()(const IgtlQuaternions&) const { return "QTDATA"; }
  std::string operator()(const IgtlPosition&) const { return "POSITION"; }
  std::string operator()(const IgtlStatus&) const { return "STATUS"; }
  std::string operator()(const IgtlStart& start) const { return "STT_" + start.what; }
  std::string operator()(const IgtlStop& stop) const { return "STP_" + stop.what; }
  std::string operator()(const IgtlGet& get) const { return "GET_" + get.what; }
  std::string operator()(const IgtlReply& reply) const { return "RTS_" + reply.what; }
  std::string operator()(const IgtlUnknown& unknown) const { return unknown.type; }
};

}  // namespace

std::string type_of(const IgtlContent& content) { return std::visit(TypeName{}, content); }

double seconds_from_stamp(std::uint64_t stamp) { return static_cast<double>(stamp) * 0x1p-32; }

std::uint64_t stamp_from_seconds(double seconds) {
  return seconds > 0 && seconds < 0x1p32 ? static_cast<std::uint64_t>(std::round(seconds * 0x1p32)) : 0;
}

std::uint64_t body_limit(std::string_view type) { return std::uint64_t{type == "IMAGE" ? 64u : 1u} << 20; }

Eigen::Matrix4d matrix_from(const Eigen::Vector3d& position, const Eigen::Vector4d& quaternion) {
  const double norm = quaternion.norm();
  const double scale = std::abs(norm - 1) <= unit_tolerance ? 1 : norm;
  const Eigen::Vector3d v = quaternion.head<3>();
  const double w = quaternion.w();
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  if (norm == 0) {
    matrix.topLeftCorner<3, 3>().setZero();
  } else {
    const double square = norm * norm;
    matrix.topLeftCorner<3, 3>() = scale / square *
                                   ((w * w - v.squaredNorm()) * Eigen::Matrix3d::Identity() +
                                    2 * v * v.transpose() + 2 * w * geometry::cross_matrix(v));
  }
  matrix.topRightCorner<3, 1>() = position;
  return matrix;
}

}  // namespace helicarm::tracker

// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/centred_view.h"

#include "helicarm/geometry/rotation.h"
#include "helicarm/geometry/triangulation.h"

namespace helicarm::calibration {

CentredView centred(const geometry::View& view, const Eigen::Vector3d& centre) {
  const geometry::Intrinsics& k = view.intrinsics;
  const Eigen::Vector3d c = view.camera_from_world * centre;
  const double rho = 1 / c.z();
  const double qx = c.x() * rho, qy = c.y() * rho;
  return {centre,
          view.camera_from_world.rotation,
          k.fx * rho,
          k.fy * rho,
          k.u0 + k.fx * qx + k.skew * qy,
          k.v0 + k.fy * qy,
          rho,
          qx,
          qy,
          k.skew * rho};
}

geometry::View uncentred(const CentredView& c) {
  const double fx = c.ax / c.rho, fy = c.ay / c.rho, skew = c.skew / c.rho;
  const Eigen::Vector3d centre_in_camera = Eigen::Vector3d(c.qx, c.qy, 1) / c.rho;
  return {{fx, fy, c.uc - fx * c.qx - skew * c.qy, c.vc - fy * c.qy, skew},
          {c.rotation, centre_in_camera - c.rotation * c.centre}};
}

CentredView moved(const CentredView& view, const ViewStep& step) {
  CentredView next = view;
  next.ax += step(0);
  next.ay += step(1);
  next.uc += step(2);
  next.vc += step(3);
  next.rotation =
      geometry::nearest_rotation(geometry::rotation_from_vector(step.segment<3>(4)) * view.rotation);
  next.rho += step(7);
  next.qx += step(8);
  next.qy += step(9);
  next.skew += step(10);
  return next;
}

ImageCoordinates image_of(const CentredView& c, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d d = c.rotation * (point_in_world - c.centre);
  const double depth = 1 + c.rho * d.z();
  const double gx = (d.x() - c.qx * d.z()) / depth;
  const double gy = (d.y() - c.qy * d.z()) / depth;
  const double along_u = c.ax * gx + c.skew * gy;
  Eigen::Matrix<double, 2, 3> by_d;
  by_d << c.ax, c.skew, -c.ax * c.qx - c.skew * c.qy - c.rho * along_u,  //
      0, c.ay, -c.ay * (c.qy + c.rho * gy);
  by_d /= depth;
  ImageCoordinates image{{c.uc + along_u, c.vc + c.ay * gy},
                         decltype(ImageCoordinates::by_step)::Zero(),
                         by_d * c.rotation,
                         depth};
  image.by_step.diagonal<0>() << gx, gy;
  image.by_step.diagonal<2>() << 1, 1;
  image.by_step.middleCols<3>(4) = -by_d * geometry::cross_matrix(d);
  image.by_step.col(7) = -d.z() / depth * Eigen::Vector2d(along_u, c.ay * gy);
  image.by_step.middleCols<2>(8) = -d.z() * by_d.leftCols<2>();
  image.by_step(0, 10) = gy;
  return image;
}

ViewCovariance parameters_by_step(const CentredView& c) {
  const double depth = 1 / c.rho;
  const Eigen::Vector3d q(c.qx, c.qy, 1);
  ViewCovariance m = ViewCovariance::Zero();
  m.topLeftCorner<2, 2>().diagonal().setConstant(depth);  // fx, fy
  m.block<2, 1>(0, 7) = -depth * depth * Eigen::Vector2d(c.ax, c.ay);
  const Eigen::Vector2d scaled(c.ax * c.qx + c.skew * c.qy, c.ay * c.qy);
  m.block<2, 2>(2, 0).diagonal() = -depth * q.head<2>();  // u0, v0
  m.block<2, 2>(2, 2).setIdentity();
  m.block<2, 1>(2, 7) = depth * depth * scaled;
  m.block<2, 2>(2, 8) << -depth * c.ax, -depth * c.skew, 0, -depth * c.ay;
  m(2, 10) = -depth * c.qy;
  m.block<3, 3>(4, 4).setIdentity();                                    // rotation
  m.block<3, 3>(7, 4) = geometry::cross_matrix(c.rotation * c.centre);  // translation
  m.block<3, 1>(7, 7) = -depth * depth * q;
  m.block<2, 2>(7, 8).diagonal().setConstant(depth);
  m(10, 7) = -depth * depth * c.skew;
  m(10, 10) = depth;
  return m;
}

Eigen::Matrix<double, 2, view_parameters> pixel_by_parameters(const geometry::View& view,
                                                              const Eigen::Vector3d& point_in_world) {
  const geometry::RigidTransform& pose = view.camera_from_world;
  const Eigen::Vector3d p = pose * point_in_world;
  const Eigen::Matrix<double, 2, 3> by_camera =
      geometry::projection_jacobian(view, point_in_world) * pose.rotation.transpose();
  Eigen::Matrix<double, 2, view_parameters> m = Eigen::Matrix<double, 2, view_parameters>::Zero();
  m.diagonal<0>() << p.x() / p.z(), p.y() / p.z();
  m.diagonal<2>() << 1, 1;
  m.middleCols<3>(4) = -by_camera * geometry::cross_matrix(pose.rotation * point_in_world);
  m.middleCols<3>(7) = by_camera;
  m(0, 10) = p.y() / p.z();
  return m;
}

}  // namespace helicarm::calibration

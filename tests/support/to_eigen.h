#pragma once

#include <Eigen/Geometry>

#include "offline/model/plane_vector.h"
#include "offline/model/pose.h"
#include "offline/model/shape.h"
#include "offline/model/space_vector.h"

namespace tumbler {

// Vectors as Eigen's, with which tests compute what they expect.

inline Eigen::Vector2d ToEigen(const PlaneVector& v) { return {v.x(), v.y()}; }
inline Eigen::Vector3d ToEigen(const SpaceVector& v) { return {v.x(), v.y(), v.z()}; }
inline SpaceVector FromEigen(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

inline Eigen::Matrix3d ToEigen(const SpaceMatrix& m) {
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 3; ++i) matrix.col(i) = ToEigen(m.col(i));
  return matrix;
}

inline Eigen::Isometry3d ToEigen(const Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = ToEigen(pose.rotation);
  X.translation() = ToEigen(pose.translation);
  return X;
}

/// The axes of a shape's core, as columns.
template <class Space>
auto AxesOf(const PosedShape<Space>& shape) {
  constexpr int kDimension = PosedShape<Space>::kDimension;
  Eigen::Matrix<double, kDimension, kDimension> axes;
  for (int i = 0; i < kDimension; ++i) axes.col(i) = ToEigen(shape.axis(i));
  return axes;
}

}  // namespace tumbler

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "common/core/index.h"

namespace tumbler {

/// A vector of space, with the names of Eigen's vectors, of which it is none for the same reason as
/// `PlaneVector`.
class SpaceVector {
 public:
  static constexpr int RowsAtCompileTime = 3;

  SpaceVector() = default;  ///< Its numbers are not set.
  SpaceVector(double x, double y, double z) : v_{x, y, z} {}

  static SpaceVector Zero() { return {0, 0, 0}; }
  static SpaceVector UnitX() { return {1, 0, 0}; }
  static SpaceVector UnitY() { return {0, 1, 0}; }
  static SpaceVector UnitZ() { return {0, 0, 1}; }
  /// The unit vector along axis i, from 0 to 2.
  static SpaceVector Unit(int i) {
    SpaceVector unit = Zero();
    unit[i] = 1;
    return unit;
  }

  [[nodiscard]] double x() const { return v_[0]; }
  [[nodiscard]] double y() const { return v_[1]; }
  [[nodiscard]] double z() const { return v_[2]; }
  double operator[](int i) const { return v_[i]; }
  double& operator[](int i) { return v_[i]; }

  friend SpaceVector operator+(const SpaceVector& a, const SpaceVector& b) {
    return {a.v_[0] + b.v_[0], a.v_[1] + b.v_[1], a.v_[2] + b.v_[2]};
  }
  friend SpaceVector operator-(const SpaceVector& a, const SpaceVector& b) {
    return {a.v_[0] - b.v_[0], a.v_[1] - b.v_[1], a.v_[2] - b.v_[2]};
  }
  friend SpaceVector operator-(const SpaceVector& a) { return {-a.v_[0], -a.v_[1], -a.v_[2]}; }
  friend SpaceVector operator*(const SpaceVector& a, double k) {
    return {a.v_[0] * k, a.v_[1] * k, a.v_[2] * k};
  }
  friend SpaceVector operator*(double k, const SpaceVector& a) { return a * k; }
  friend SpaceVector operator/(const SpaceVector& a, double k) {
    return {a.v_[0] / k, a.v_[1] / k, a.v_[2] / k};
  }
  SpaceVector& operator+=(const SpaceVector& a) { return *this = *this + a; }
  SpaceVector& operator-=(const SpaceVector& a) { return *this = *this - a; }
  SpaceVector& operator*=(double k) { return *this = *this * k; }
  bool operator==(const SpaceVector&) const = default;

  [[nodiscard]] double dot(const SpaceVector& a) const {
    return v_[0] * a.v_[0] + (v_[1] * a.v_[1] + v_[2] * a.v_[2]);
  }
  [[nodiscard]] SpaceVector cross(const SpaceVector& a) const {
    return {y() * a.z() - z() * a.y(), z() * a.x() - x() * a.z(), x() * a.y() - y() * a.x()};
  }
  [[nodiscard]] double squaredNorm() const { return dot(*this); }
  [[nodiscard]] double norm() const { return std::sqrt(squaredNorm()); }
  [[nodiscard]] bool allFinite() const {
    return std::isfinite(v_[0]) && std::isfinite(v_[1]) && std::isfinite(v_[2]);
  }
  /// Of unit length; as it is where it has no length.
  [[nodiscard]] SpaceVector normalized() const { return norm() > 0 ? *this / norm() : *this; }

 private:
  IntArray<double, 3> v_;
};

/// A matrix of three rows and columns.
class SpaceMatrix {
 public:
  SpaceMatrix() = default;  ///< Its numbers are not set.
  /// Of these columns.
  SpaceMatrix(const SpaceVector& x, const SpaceVector& y, const SpaceVector& z)
      : columns_{x, y, z} {}

  static SpaceMatrix Zero() {
    return {SpaceVector::Zero(), SpaceVector::Zero(), SpaceVector::Zero()};
  }
  static SpaceMatrix Identity() { return Diagonal({1, 1, 1}); }
  static SpaceMatrix Diagonal(const SpaceVector& d) {
    return {{d.x(), 0, 0}, {0, d.y(), 0}, {0, 0, d.z()}};
  }
  /// a b^T
  static SpaceMatrix Outer(const SpaceVector& a, const SpaceVector& b) {
    return {a * b.x(), a * b.y(), a * b.z()};
  }

  double operator()(int row, int column) const { return col(column)[row]; }
  double& operator()(int row, int column) { return col(column)[row]; }
  [[nodiscard]] const SpaceVector& col(int i) const { return columns_[i]; }
  [[nodiscard]] SpaceVector& col(int i) { return columns_[i]; }
  [[nodiscard]] SpaceVector row(int i) const { return {col(0)[i], col(1)[i], col(2)[i]}; }

  friend SpaceMatrix operator+(const SpaceMatrix& a, const SpaceMatrix& b) {
    return {a.col(0) + b.col(0), a.col(1) + b.col(1), a.col(2) + b.col(2)};
  }
  friend SpaceMatrix operator-(const SpaceMatrix& a, const SpaceMatrix& b) {
    return {a.col(0) - b.col(0), a.col(1) - b.col(1), a.col(2) - b.col(2)};
  }
  friend SpaceMatrix operator*(const SpaceMatrix& a, double k) {
    return {a.col(0) * k, a.col(1) * k, a.col(2) * k};
  }
  friend SpaceMatrix operator*(double k, const SpaceMatrix& a) { return a * k; }
  friend SpaceVector operator*(const SpaceMatrix& a, const SpaceVector& v) {
    return {a.row(0).dot(v), a.row(1).dot(v), a.row(2).dot(v)};
  }
  friend SpaceMatrix operator*(const SpaceMatrix& a, const SpaceMatrix& b) {
    return {a * b.col(0), a * b.col(1), a * b.col(2)};
  }
  SpaceMatrix& operator+=(const SpaceMatrix& a) { return *this = *this + a; }
  bool operator==(const SpaceMatrix&) const = default;

  [[nodiscard]] SpaceMatrix transpose() const { return {row(0), row(1), row(2)}; }
  /// A^T v
  [[nodiscard]] SpaceVector TransposeTimes(const SpaceVector& v) const {
    return {col(0).dot(v), col(1).dot(v), col(2).dot(v)};
  }
  [[nodiscard]] double trace() const { return (*this)(0, 0) + ((*this)(1, 1) + (*this)(2, 2)); }

 private:
  IntArray<SpaceVector, 3> columns_;
};

}  // namespace tumbler

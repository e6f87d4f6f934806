#pragma once

#include <cmath>

namespace tumbler {

/// A vector of the x-z plane, with the names of Eigen's vectors, so that templates take either.
/// `y()` is its second number, which is z in the plane. It is no Eigen::Vector2d because that takes
/// long to compile wherever planar motion is computed. Like that, it lies in one register.
class PlaneVector {
  /// Two numbers with which the processor computes at once.
  using Pair [[gnu::vector_size(16)]] = double;

 public:
  static constexpr int RowsAtCompileTime = 2;

  PlaneVector() = default;  ///< Its numbers are not set.
  PlaneVector(double x, double y) : v_{x, y} {}

  static PlaneVector Zero() { return {0, 0}; }
  static PlaneVector UnitX() { return {1, 0}; }
  static PlaneVector UnitY() { return {0, 1}; }
  /// The unit vector along axis i, which is 0 or 1.
  static PlaneVector Unit(int i) { return i == 0 ? UnitX() : UnitY(); }

  [[nodiscard]] double x() const { return v_[0]; }
  [[nodiscard]] double y() const { return v_[1]; }
  double& x() { return (*this)[0]; }
  double& y() { return (*this)[1]; }
  double operator[](int i) const { return v_[i]; }
  double& operator[](int i) { return reinterpret_cast<double*>(&v_)[i]; }

  friend PlaneVector operator+(const PlaneVector& a, const PlaneVector& b) {
    return PlaneVector(a.v_ + b.v_);
  }
  friend PlaneVector operator-(const PlaneVector& a, const PlaneVector& b) {
    return PlaneVector(a.v_ - b.v_);
  }
  friend PlaneVector operator-(const PlaneVector& a) { return PlaneVector(-a.v_); }
  friend PlaneVector operator*(const PlaneVector& a, double k) { return PlaneVector(a.v_ * k); }
  friend PlaneVector operator*(double k, const PlaneVector& a) { return a * k; }
  friend PlaneVector operator/(const PlaneVector& a, double k) { return PlaneVector(a.v_ / k); }
  PlaneVector& operator+=(const PlaneVector& a) { return *this = *this + a; }
  PlaneVector& operator-=(const PlaneVector& a) { return *this = *this - a; }
  PlaneVector& operator*=(double k) { return *this = *this * k; }
  bool operator==(const PlaneVector& a) const { return x() == a.x() && y() == a.y(); }

  [[nodiscard]] double dot(const PlaneVector& a) const {
    const Pair products = v_ * a.v_;
    return products[0] + products[1];
  }
  [[nodiscard]] double squaredNorm() const { return dot(*this); }
  [[nodiscard]] double norm() const { return std::sqrt(squaredNorm()); }
  [[nodiscard]] bool allFinite() const { return std::isfinite(v_[0]) && std::isfinite(v_[1]); }
  /// Of unit length; as it is where it has no length.
  [[nodiscard]] PlaneVector normalized() const {
    return squaredNorm() > 0 ? *this / norm() : *this;
  }

 private:
  explicit PlaneVector(Pair v) : v_(v) {}

  Pair v_;
};

}  // namespace tumbler

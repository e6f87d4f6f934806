#pragma once

#include <array>
#include <cstddef>
#include <type_traits>
#include <utility>

#include "offline/scene/lane_robot.h"

namespace tumbler {
inline namespace TUMBLER_LANES_NAMESPACE {

/// Which body carries which, for loops over bodies. `AnyTree` asks the model; `KnownTree` knows it
/// when it is compiled, so that loops over it are unrolled and what they compute stays in
/// registers. Both go through the same bodies in the same order, and the results have the same
/// bits.
///
/// The root link is body 0, and the joint i moves body i, from 1 on.
class AnyTree {
 public:
  explicit AnyTree(const LaneModel& model) : m_(model) {}

  [[nodiscard]] std::size_t joints() const { return m_.joints; }
  [[nodiscard]] std::size_t parent(std::size_t body) const { return m_.parent[body]; }
  /// What is positive about -y, about a body's axis.
  template <class S>
  [[nodiscard]] S AboutAxis(std::size_t body, const S& x) const {
    return S(m_.axis[body]) * x;
  }

  /// Calls f(body) for every joint's body, from the root outwards.
  template <class F>
  void Outwards(const F& f) const {
    for (std::size_t i = 1; i <= joints(); ++i) f(i);
  }
  /// The same, inwards.
  template <class F>
  void Inwards(const F& f) const {
    for (std::size_t i = joints(); i > 0; --i) f(i);
  }
  /// Calls f(a) for a body and those between it and the root, which is left out.
  template <class F>
  void UpFrom(std::size_t body, const F& f) const {
    for (std::size_t a = body; a > 0; a = parent(a)) f(a);
  }

 private:
  const LaneModel& m_;
};

/// All axes are -y: a robot with another has AnyTree.
/// @tparam kParents  of the bodies of joints, from the first joint on.
template <std::size_t... kParents>
class KnownTree {
  template <std::size_t i>
  using Body = std::integral_constant<std::size_t, i>;
  static constexpr std::array<std::size_t, sizeof...(kParents) + 1> kParent = {0, kParents...};

 public:
  explicit KnownTree(const LaneModel& /*model*/) {}
  /// Whether a model has this tree.
  static bool IsOf(const LaneModel& model) {
    bool same = model.joints == joints();
    for (std::size_t i = 1; same && i <= joints(); ++i)
      same = model.parent[i] == kParent[i] && model.axis[i] == 1;
    return same;
  }

  [[nodiscard]] static constexpr std::size_t joints() { return sizeof...(kParents); }
  [[nodiscard]] static constexpr std::size_t parent(std::size_t body) { return kParent[body]; }
  template <class S>
  [[nodiscard]] static S AboutAxis(std::size_t /*body*/, const S& x) {
    return x;
  }

  template <class F>
  [[gnu::always_inline]] static void Outwards(const F& f) {
    [&]<std::size_t... i>(std::index_sequence<i...>) __attribute__((always_inline)) {
      (f(Body<i + 1>{}), ...);
    }
    (std::make_index_sequence<joints()>{});
  }
  template <class F>
  [[gnu::always_inline]] static void Inwards(const F& f) {
    [&]<std::size_t... i>(std::index_sequence<i...>) __attribute__((always_inline)) {
      (f(Body<joints() - i>{}), ...);
    }
    (std::make_index_sequence<joints()>{});
  }
  template <std::size_t body, class F>
  [[gnu::always_inline]] static void UpFrom(Body<body> first, const F& f) {
    if constexpr (body > 0) {
      f(first);
      UpFrom(Body<kParent[body]>{}, f);
    }
  }
};

}  // namespace TUMBLER_LANES_NAMESPACE
}  // namespace tumbler

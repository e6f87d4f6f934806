#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "offline/model/planar_robot.h"
#include "offline/model/plane.h"
#include "offline/model/spatial.h"

namespace tumbler {

struct SpaceRobot;

/// A shape that a body of a robot in space fills, for its distance from the robot's other bodies.
struct SpaceOwnShape {
  std::string name;  ///< `LINK/INDEX`; of a shape that is only drawn, `LINK/visual/INDEX`.
  std::string link;  ///< The link of the file.
  int body = 0;      ///< Index of the degree of freedom that moves it.
  Shape<Spatial> shape;
  bool drawn_only = false;  ///< Whether it is a visual shape, and no collision shape is the same.
};

/// Two of a robot's own shapes.
struct OwnPair {
  int a = 0, b = 0;  ///< Indices of PlanarRobot::own_shapes.
  bool operator==(const OwnPair&) const = default;
};

/// A distance that falls short of the clearance by this much counts as an excess of 1.
inline constexpr double kClearanceScale_m = 0.01;

/// Which of a robot's own shapes have to stay apart, and how far.
struct SelfContact {
  double clearance_m = 0.005;
  std::vector<OwnPair> pairs;
  /// Pairs with a joint without a motor between their bodies. No path keeps them apart, so the
  /// solver has no limit for them; whatever is simulated is looked at for them, too.
  std::vector<OwnPair> simulated;

  [[nodiscard]] std::vector<OwnPair> All() const {
    std::vector<OwnPair> all = pairs;
    all.insert(all.end(), simulated.begin(), simulated.end());
    return all;
  }
};

/// Whether drawn shapes count as well as collision shapes.
enum class OwnShapes { kAll, kCollision, kNone };

/// The pairs of a robot's own shapes that have to stay apart. Left out are
/// - those on one body;
/// - those that pass beside each other, as their extents along y are the clearance or more apart;
/// - on the two bodies of a joint, those that are nearer than the clearance in half of the joint's
///   range or more, since they meet at the joint by construction, and those whose distance the
///   joint does not change. The joint is looked at in 65 positions; the range of one without limits
///   is a turn, or 1 m to either side.
std::vector<OwnPair> SeparatePairs(const PlanarRobot& robot, OwnShapes shapes, double clearance_m);
/// The same in space, where nothing passes beside anything: a pair whose extents along y are apart
/// is one like any other.
std::vector<OwnPair> SeparatePairs(const SpaceRobot& robot, OwnShapes shapes, double clearance_m);

/// "leg1_link/0 and leg2_link/visual/1"
std::string NameOf(const PlanarRobot& robot, const OwnPair& pair);
std::string NameOf(const SpaceRobot& robot, const OwnPair& pair);

/// The nearest two of a robot's own shapes.
struct SelfClearance {
  /// Negative where the shapes overlap: then by how much they have to move to be free of each
  /// other. Infinite for a robot without pairs.
  double distance_m = std::numeric_limits<double>::infinity();
  OwnPair pair;
};

/// The distances between a robot's own shapes, which depend on its joints alone. Distances are
/// those in the plane of motion, or in space.
///
/// No heap after construction.
template <class Space>
class SelfDistancesIn {
 public:
  using Vector = typename Space::Vector;
  using RobotOf = std::conditional_t<std::is_same_v<Space, Plane>, PlanarRobot, SpaceRobot>;

  SelfDistancesIn(const RobotOf& robot, std::span<const OwnPair> pairs);

  /// A pair that is near, and the derivative of its distance by each degree of freedom.
  struct Near {
    OwnPair pair;
    double distance_m = 0;
    std::array<double, Space::kMaxDofs> slopes{};
  };

  /// The pairs nearer than `limit_m`. Valid until the next call.
  /// @param q  positions of all degrees of freedom; those of the root do not matter.
  std::span<const Near> FindNearer(std::span<const double> q, double limit_m);

  /// The nearest pair, where it may be nearer than `limit_m`; else the default.
  /// @param q  likewise.
  SelfClearance Nearest(std::span<const double> q,
                        double limit_m = std::numeric_limits<double>::infinity());

 private:
  struct Joint {
    int parent;
    JointKind kind;
    typename Space::Axis axis;
    Vector direction, offset;
  };
  struct Body {
    typename Space::Rotation R;
    Vector p = Vector::Zero();
  };
  struct Own {
    Shape<Space> shape;
    int body;
    double reach_m;  // radius of a circle around its centre that holds it
    Vector centre;
  };
  /// A pair, and the bodies whose joints change its distance: the way from one to the other.
  struct Pair {
    OwnPair pair;
    std::uint32_t moves_a,
        moves_b;  // bits of degrees of freedom that only a's body hangs on, or b's
    Vector u;     // from b to a, where they were nearest when that was last found; 0: never was
  };

  void FindSweeps();
  /// Whether no pair can be nearer than `limit_m`, because the joints have hardly moved since
  /// distances were last found.
  [[nodiscard]] bool StillApart(std::span<const double> q, double limit_m) const;
  /// Keeps what StillApart asks for.
  void RememberApart(std::span<const double> q, double distance_m);
  void SetPositions(std::span<const double> q);
  [[nodiscard]] const Body& BodyOf(int body) const;
  /// The velocity of a point that turns about a revolute joint's axis at unit rate.
  [[nodiscard]] Vector VelocityAbout(std::size_t joint, const Vector& point) const {
    const Body& body = bodies_[joint];
    const auto w = Space::RevoluteMotion(body.R, joints_[joint].axis, body.p).w;
    return Space::Cross(w, Vector(point - body.p));
  }
  /// A distance that the pair is not nearer than, by circles around its shapes.
  [[nodiscard]] double Bound(const OwnPair& pair) const;
  /// Likewise what is between them along Pair::u. While joints move by little that is nearly their
  /// distance, for a small part of the price.
  [[nodiscard]] static double BoundAlong(const Vector& u, const PosedShape<Space>& a,
                                         const PosedShape<Space>& b);
  [[nodiscard]] PosedShape<Space> Posed(int shape) const;

  int root_dofs_;
  std::size_t first_joint_;
  std::vector<Joint> joints_;
  std::vector<Body> bodies_;
  Body world_;
  std::vector<Own> shapes_;
  std::vector<Pair> pairs_;
  std::vector<Near> near_;
  // By degree of freedom, how far any of its shapes goes at most when it moves by one [m/rad].
  std::vector<double> sweep_;
  std::vector<double> found_at_;  // positions for which distances were last found
  double apart_m_ = 0;            // no pair was nearer than this there
};

using SelfDistances = SelfDistancesIn<Plane>;
using SpaceSelfDistances = SelfDistancesIn<Spatial>;

}  // namespace tumbler

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "offline/model/contact_forces.h"
#include "offline/model/contact_law.h"
#include "offline/model/contact_shape.h"
#include "offline/model/near_points.h"
#include "offline/model/obstacle.h"

namespace tumbler {

/// All contacts of a robot with the obstacles of a task, and with itself where that is asked for
/// [AB04, section III]. The derivatives are exact, and include the motion of contact points and
/// normals.
///
/// Each pair of shapes is one contact, at its near points. There is one exception: a capsule or box
/// has a contact of its own for each end or vertex with a half-space. A face that lies flat would
/// have one near point, which jumps from vertex to vertex, and the force with it.
///
/// The force is a C1 function of the state for spheres with spheres, and for all shapes with
/// half-spaces. With other shapes the curvature of the touching surfaces jumps where a near point
/// passes from a face to an edge or vertex: the force is continuous there, and its derivative
/// jumps. Between parallel edges or faces (`NearPoints::unique`) the point of attack jumps too. A
/// robot that is to lie on an obstacle's face should do so with spheres.
template <class Space>
class ContactModel final : public ContactForces<Space> {
 public:
  using Vector = typename Space::Vector;

  /// @param own_pairs  pairs of the robot's shapes that can touch each other.
  ContactModel(const ContactLaw& law, std::vector<ContactShape<Space>> shapes,
               std::vector<Obstacle<Space>> obstacles,
               const std::vector<ContactPair>& own_pairs = {});

  void Apply(HybridDynamics<Space>& dynamics) override;

  void Differentiate(HybridDynamics<Space>& dynamics) const override;

  [[nodiscard]] std::span<const ActiveContact<Space>> active() const override {
    return {active_.data(), active_count_};
  }

  [[nodiscard]] std::uint64_t Pieces() const override;

  void AddDepthSlopes(const HybridDynamics<Space>& dynamics, const ActiveContact<Space>& active,
                      double scale, std::span<double> slopes) const override;

  [[nodiscard]] double LoadedSlip() const override;
  void AddLoadedSlipSlopes(const HybridDynamics<Space>& dynamics, double scale,
                           std::span<double> by_q, std::span<double> by_qd) const override;

  [[nodiscard]] const ContactLaw& law() const { return law_; }
  [[nodiscard]] const std::vector<ContactShape<Space>>& shapes() const { return shapes_; }
  [[nodiscard]] const std::vector<Obstacle<Space>>& obstacles() const { return obstacles_; }

 private:
  /// A sphere, or a vertex of a shape with its swept radius.
  struct Point {
    int shape;
    int body;
    Vector centre;
    double radius_m;
  };
  /// Two shapes that meet at general near points: a shape of the robot, and an obstacle or another
  /// shape of the robot.
  struct GeneralPair {
    int shape;
    int obstacle;
    int other_shape;
  };
  struct Evaluation {
    NearPoint<Space> near;
    int pair;  // index in pairs_; -1 for a point
    int body;
    int other_body;  // -1: the world
    double radius;
    Vector c, p, v, v_t, F;
    NormalForce normal;
    FrictionGain friction;
  };

  struct ForceChange;

  /// Most points are out of reach, which is seen without a call.
  [[gnu::always_inline]] void AddPoint(HybridDynamics<Space>& dynamics, const Point& point,
                                       const Vector& c, const Vector& world, int obstacle);
  void AddPair(HybridDynamics<Space>& dynamics, std::size_t k);
  [[nodiscard]] PosedShape<Space> PosedOn(const HybridDynamics<Space>& dynamics, int shape) const;
  [[nodiscard]] PosedShape<Space> PosedA(const HybridDynamics<Space>& dynamics,
                                         const GeneralPair& pair) const;
  [[nodiscard]] PosedShape<Space> PosedB(const HybridDynamics<Space>& dynamics,
                                         const GeneralPair& pair) const;
  /// Computes the force at e.near, e.p and e.v, and makes it the next active contact.
  typename Space::Wrench SetForce(Evaluation& e, int shape, int obstacle, int other_shape);
  void DifferentiatePoint(HybridDynamics<Space>& dynamics, const Evaluation& e) const;
  /// The derivatives of a point's wrench, for `HybridDynamics::AddWrenchDerivative`.
  template <class Motion, class WrenchMap>
  static void MapsInSpace(const ForceChange& change, const Motion& body_v, WrenchMap& stiffness,
                          WrenchMap& damping);
  void DifferentiatePair(HybridDynamics<Space>& dynamics, const Evaluation& e) const;

  ContactLaw law_;
  std::vector<ContactShape<Space>> shapes_;
  std::vector<Obstacle<Space>> obstacles_;
  std::vector<Point> spheres_;    // meet all obstacles
  std::vector<Point> vertices_;   // meet half-spaces
  std::vector<int> half_spaces_;  // indices in obstacles_
  std::vector<GeneralPair> pairs_;
  std::vector<NearPoints<Space>> near_;  // of pairs_, where active
  // These have room for as many as there could be at once.
  std::vector<Evaluation> evaluations_;
  std::vector<ActiveContact<Space>> active_;
  std::size_t active_count_ = 0;
};

}  // namespace tumbler

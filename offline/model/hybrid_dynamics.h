#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/core/index.h"
#include "offline/model/tree.h"

namespace tumbler {

/// Partial derivatives of the outputs of hybrid dynamics, n by n for n degrees of freedom. The
/// output of degree of freedom i (row i) is its acceleration where it is free, and its force or
/// torque where it is prescribed.
template <class Space>
struct DynamicsDerivatives {
  using Block = IntArray<IntArray<double, Space::kMaxDofs>, Space::kMaxDofs>;
  /// By positions (columns).
  Block q;
  /// By velocities.
  Block qd;
  /// By the given inputs: accelerations of prescribed degrees of freedom, forces or torques of free
  /// ones.
  Block input;
};

/// Hybrid dynamics g of a tree, [AB04, Eq. 7], and its derivative dg, [AB04, Eq. 9]:
///
///   (tau_a, qdd_p) = g(q, qd, qdd_a, tau_p),   M(q) qdd + b(q, qd) = tau + sum_c J_c^T f_c
///
/// Prescribed degrees of freedom (a) have their acceleration given, and free ones (p) their force
/// or torque. Contact wrenches act from outside.
///
/// Method: inverse dynamics gives tau at qdd_p = 0; the free rows of the joint-space inertia M give
/// qdd_p by Cholesky's factorisation; dg is the derivative of inverse dynamics in closed form
/// [SRW22, Eqs. 34-37], partitioned the same way. Everything is expressed with world axes about the
/// first body's origin, which keeps numbers small however far the robot travels, and makes the
/// root's translations constant. `Space` is the algebra, `Plane` or `Spatial`.
///
/// Order of calls: SetState; AddWrench for every contact; Solve; then for derivatives
/// AddWrenchDerivative or AddPairDerivative for every contact, and Differentiate or
/// DifferentiateFactored.
///
/// Cost: O(n d) for tree depth d, plus O(n_p^3). No heap after construction. Units: SI.
///
/// [AB04] J. Albro, J. Bobrow, 2004. [SRW22] S. Singh, R. Russell, P. Wensing, Efficient Analytical
/// Derivatives of Rigid-Body Dynamics Using Spatial Vector Algebra, IEEE RA-L 7(2), 2022.
template <class Space>
class HybridDynamics {
 public:
  using Vector = typename Space::Vector;
  using Motion = typename Space::Motion;
  using Rate = typename Space::Rate;
  using Wrench = typename Space::Wrench;
  using WrenchMap = typename Space::WrenchMap;
  using Rotation = typename Space::Rotation;
  using Derivatives = DynamicsDerivatives<Space>;
  static constexpr int kMaxDofs = Space::kMaxDofs;
  static_assert(kMaxDofs <= 32, "sets of bodies are kept as bits of a 32-bit word");

  /// @pre 1 <= dofs <= kMaxDofs, parents come before children, and every set of free degrees of
  /// freedom moves inertia.
  explicit HybridDynamics(const Tree<Space>& tree);

  [[nodiscard]] int size() const { return n_; }
  [[nodiscard]] bool prescribed(int j) const { return joints_[j].prescribed; }

  /// Puts this rotation in front of the root's own: the axes in which its angles are zero. It stays
  /// until the next call. From the next SetState on.
  /// @pre the first degrees of freedom are the root's translations.
  void SetRootAxes(const Rotation& R) { bodies_[slides_ - 1].R = R; }

  /// Sets positions and velocities of all degrees of freedom, and forgets all wrenches.
  void SetState(std::span<const double> q, std::span<const double> qd);

  /// The origin of the coordinates in use, in the world. It belongs to the state.
  [[nodiscard]] const Vector& origin() const { return origin_; }
  /// Rotation of body j, its position relative to `origin()`, and its velocity. After SetState.
  [[nodiscard]] const Rotation& rotation(int j) const { return bodies_[j].R; }
  [[nodiscard]] const Vector& position(int j) const { return bodies_[j].p; }
  [[nodiscard]] const Motion& velocity(int j) const { return bodies_[j].v; }
  [[nodiscard]] int parent(int j) const { return joints_[j].parent; }

  /// Adds an external wrench about `origin()` on body j.
  void AddWrench(int j, const Wrench& wrench) {
    bodies_[j].external = bodies_[j].external + wrench;
  }

  /// Adds J^T w, the joint forces that do the work of the wrench about `origin()` on body j. They
  /// are also the derivative by all positions of a quantity that grows at the rate of this work.
  void AddJointForces(int j, const Wrench& wrench, std::span<double> forces) const {
    for (int i = j; i >= 0; i = joints_[i].parent)
      forces[Index(i)] += Space::Dot(bodies_[i].S, wrench);
  }

  /// Adds the derivatives, by all positions and velocities, of a quantity of the motion of body j:
  /// `by_place` tells of a displacement of the body, which carries its velocity along, and
  /// `by_velocity` of a change of its velocity, by their products with the two. After SetState.
  void AddStateSlopes(int j, const Wrench& by_place, const Wrench& by_velocity,
                      std::span<double> by_q, std::span<double> by_qd) const {
    for (int i = j; i >= 0; i = joints_[i].parent) {
      const Body& body = bodies_[i];
      by_q[Index(i)] += Space::Dot(body.S, by_place) + Space::Dot(body.S_rate, by_velocity);
      by_qd[Index(i)] += Space::Dot(body.S, by_velocity);
    }
  }

  /// Solves the equations of motion. Reads qdd of prescribed and tau of free degrees of freedom,
  /// and writes the others.
  void Solve(std::span<double> qdd, std::span<double> tau);

  /// The accelerations of the free degrees of freedom that these torques on them add to Solve's:
  /// the equations are linear in torques. After Solve.
  /// @param torques  of all degrees of freedom; those of prescribed ones do not matter.
  /// @param qdd      written for the free ones.
  void Respond(std::span<const double> torques, std::span<double> qdd) const;

  /// A free degree of freedom whose acceleration is not determined, or lost to rounding, or -1:
  /// coordinates are at a singularity, or bodies lack inertia. It is the first one of whose inertia
  /// only the fraction `tolerance` or less is left once the free ones before it may move. After
  /// Solve.
  [[nodiscard]] int FindUndetermined(double tolerance) const {
    for (int i = 0; i < free_count_; ++i) {
      const double own = M_[free_[i]][free_[i]];
      const double inverse_root = L_[i][i];
      if (!(1 / (inverse_root * inverse_root) > tolerance * own)) return free_[i];
    }
    return -1;
  }

  /// Adds to the derivative of the wrench W on body j. `stiffness` maps a displacement u of the
  /// body, which carries its velocity along, to dW - u x* W. `damping` maps a change of the body's
  /// velocity to dW. After Solve, before Differentiate.
  void AddWrenchDerivative(int j, const WrenchMap& stiffness, const WrenchMap& damping) {
    WrenchDerivative& sum = bodies_[j].wrench_derivative;
    if ((touched_ >> j & 1U) == 0) {
      touched_ |= 1U << j;
      sum = {stiffness, damping};
      return;
    }
    sum.stiffness += stiffness;
    sum.damping += damping;
  }

  /// Adds to the derivatives of a wrench W on body a and of -W on body b, where W depends only on
  /// the motion of a relative to b. The maps, as above, are those of moving a with b at rest.
  /// AddWrench has to be given both wrenches as well. After Solve, before Differentiate.
  void AddPairDerivative(int a, int b, const Wrench& W, const WrenchMap& stiffness,
                         const WrenchMap& damping);

  /// All derivatives of Solve's outputs at its solution.
  void Differentiate(Derivatives& out);

  /// The same in factored form, which is cheaper. `out.input` is as above, but `out.q` and `out.qd`
  /// hold the derivatives D of inverse dynamics, that is of tau at fixed qdd. With p the free and a
  /// the prescribed degrees of freedom,
  ///
  ///   dg_q = R D_q,   R_ap = -input_ap,   R_pp = -input_pp,   R_aa = 1,   R_pa = 0,
  ///
  /// and likewise for qd. So a cotangent r of the outputs is pulled back to q as D_q^T (R^T r), and
  /// to the prescribed accelerations as the rows a of M (R^T r), as M is the derivative of inverse
  /// dynamics by accelerations. input_pp is symmetric and input_ap = -input_pa^T.
  /// @param by_prescribed  false: input_aa is not needed, and not written.
  void DifferentiateFactored(Derivatives& out, bool by_prescribed = true);
  /// M. It is zero for two degrees of freedom of which neither carries the other. After Solve.
  [[nodiscard]] const typename Derivatives::Block& inertia() const { return M_; }

  /// Kinetic energy, and potential energy with its zero at the world's origin [J]. After SetState.
  [[nodiscard]] double KineticEnergy() const;
  [[nodiscard]] double PotentialEnergy() const;
  /// Momentum of the whole tree about the world's origin. After SetState.
  [[nodiscard]] Wrench Momentum() const;

 private:
  struct Joint {
    int parent;
    JointKind kind;
    bool prescribed;
    bool massless;
    typename Space::Axis axis;
    Vector direction, offset, mass_centre;
    double mass;
    typename Space::BodyInertia inertia;
    double rotor_inertia, damping;
  };
  struct WrenchDerivative {
    WrenchMap stiffness, damping;
  };
  struct Body {
    typename Space::Turn turn;        // of the joint
    std::uint64_t angle_of_turn = 0;  // its bits: those of 0 rad
    Rotation R;
    Vector p;     // relative to origin_
    Motion S;     // axis
    Rate S_rate;  // v_parent x S
    Motion v;
    double qd, qdd;
    typename Space::Inertia own;  // of the body
    Wrench momentum;              // own * v
    Wrench turned;                // v x* momentum
    Wrench external;
    Motion a;                            // acceleration, gravity included as -g at the world
    Rate S_rate2;                        // a_parent x S + v_parent x S_rate
    typename Space::Inertia composite;   // of the subtree; of slides only the mass
    typename Space::Bias bias;           // of the subtree
    Wrench force;                        // of the subtree
    Wrench composite_S;                  // composite * S; not of slides
    WrenchDerivative wrench_derivative;  // of the body; valid where touched
    WrenchDerivative contact;            // of the subtree, where several of its bodies are touched
  };
  /// By body, the wrenches' derivatives of the subtree: those of the one touched body in it, or
  /// the sum `Body::contact`; null: none is touched.
  using Contacts = IntArray<const WrenchDerivative*, kMaxDofs>;
  /// Calls work(number of free degrees of freedom). Those that are common (`Space`) are given as
  /// constants, for which the loops over them are compiled without loops.
  template <class Work>
  void WithFreeCount(Work&& work) const {
    WithFreeCount(work, typename Space::CommonFreeCounts());
  }
  template <class Work, int... kCounts>
  void WithFreeCount(Work& work, std::integer_sequence<int, kCounts...> /*common*/) const {
    const bool common =
        ((free_count_ == kCounts && (work(std::integral_constant<int, kCounts>()), true)) || ...);
    if (!common) work(free_count_);
  }
  template <class Count>
  void FactorFreeInertia(Count count);
  template <class Count>
  void SolveFree(Count count, double* x) const;
  /// Accelerations, forces and bias maps of the bodies at Solve's solution.
  void MoveBodiesAtSolution();
  void DifferentiateInverse(typename Derivatives::Block& d_q, typename Derivatives::Block& d_qd);
  void DifferentiateSlides(Contacts& contacts, typename Derivatives::Block& d_q,
                           typename Derivatives::Block& d_qd);
  /// Adds the contacts of a body to those of the one that carries it.
  void CarryContacts(int body, int carrier, Contacts& contacts);
  /// Adds what AddPairDerivative summed up.
  void AddPairs(typename Derivatives::Block& d_q, typename Derivatives::Block& d_qd) const;
  template <class Count>
  void DifferentiateByInput(Count count, typename Derivatives::Block& input,
                            bool by_prescribed) const;
  /// Makes of the derivative of inverse dynamics that of Solve's outputs.
  template <class Count>
  void MultiplyOut(Count count, Derivatives& out) const;
  template <class Count>
  void AddProducts(Count count, const IntArray<double, kMaxDofs>& R,
                   const typename Derivatives::Block& D, IntArray<double, kMaxDofs>& row) const;

  int n_ = 0;
  int first_body_ = 0;
  /// How many of the first degrees of freedom are the root's translations: each moves along the
  /// world's axes, and has no mass of its own. Their axes never change.
  int slides_ = 0;
  int free_count_ = 0;
  IntArray<int, kMaxDofs> free_{};        // degree of freedom of each row of the free inertia
  IntArray<int, kMaxDofs> free_index_{};  // and back; -1 where prescribed
  int prescribed_count_ = 0;
  IntArray<int, kMaxDofs> prescribed_{};
  Vector gravity_;
  Vector origin_ = Vector::Zero();
  IntArray<Joint, kMaxDofs> joints_;
  IntArray<Body, kMaxDofs> bodies_;
  typename Derivatives::Block M_;  // joint-space inertia; zero off the tree's branches
  IntArray<IntArray<double, kMaxDofs>, kMaxDofs> L_;  // Cholesky factor; diagonal inverted
  std::uint32_t touched_ = 0;                         // bodies with a wrench derivative
  bool any_pair_ = false;
  typename Derivatives::Block pair_q_, pair_qd_;  // the share of pairs in the derivative of tau
  /// Degrees of freedom [begin, end) that neither carry that of the row nor are carried by it.
  struct Unrelated {
    int row, begin, end;
  };
  std::vector<Unrelated> unrelated_;
};

}  // namespace tumbler

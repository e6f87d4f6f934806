#pragma once

#include <ode/ode.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "offline/problem/simulated_motion.h"
#include "tests/offline/played_motion.h"

namespace tumbler::testing {

/// A ground of the Open Dynamics Engine.
struct OdeGround {
  double mu = 0;
  /// 0: hard. What penetrates is out again within a few steps, and does not bounce.
  double stiffness_n_per_m = 0;
  double damping_n_s_per_m = 0;
};

/// The robot of a motion in the Open Dynamics Engine (ODE): a body for each link, in the engine's
/// x-y plane with y up. The root is held in the plane, and hinges hold the legs, each by
/// constraints. Joints have no stops: plans stay within the limits, and drives follow them.
///
/// ODE has no inertia of a rotor that resists a joint's acceleration alone. It is part of what
/// a motor of ODE does, which is the softened constraint v' + C T = v* for a joint's velocity v' at
/// the step's end and the torque T on the links. A drive whose rotor has the inertia J, with
/// viscous friction b, that is to exert the torque D, leaves the links T = D - J (v' - v) / h - b
/// v', so that C = 1 / (J / h + b) and v* = C (D + J v / h). That is what a rotor's own momentum
/// would do in the same step, and holds however long the step is.
class OdeRobot : public Engine {
 public:
  /// @param factors  of the links' masses; empty: the model's.
  /// @throws std::invalid_argument  for what the shipped tumbler does not have: shapes that are no
  /// spheres, obstacles that are no half-spaces, joints without a rotor, springs, other motors.
  OdeRobot(const SimulatedMotion& motion, const DriveGains& gains, const OdeGround& ground,
           const std::vector<double>& mass_factors, double step_s);

  void Begin() override;
  void PlayTo(double time_s, const std::vector<double>& ctrl) override;
  [[nodiscard]] double Position(const std::string& joint) const override;

  /// Puts all degrees of freedom, in the order of the robot's tree.
  void Set(std::span<const double> q, std::span<const double> qd);
  void Step(const std::vector<double>& ctrl);
  /// Of all degrees of freedom.
  [[nodiscard]] std::vector<double> Positions() const;
  [[nodiscard]] std::vector<double> Velocities() const;

 private:
  struct Joint {
    std::size_t dof = 0;
    dBodyID link = nullptr, parent = nullptr;
    dJointID motor = nullptr;
    double rotor_inertia_kg_m2 = 0, damping_nm_s_per_rad = 0, torque_max_nm = 0;
    double axis = 1;
    double position_rad = 0;  ///< May be more than half a turn.
  };
  struct Ends {
    void operator()(dxWorld* world) const { dWorldDestroy(world); }
    void operator()(dxJointGroup* group) const { dJointGroupDestroy(group); }
    void operator()(dxGeom* geom) const { dGeomDestroy(geom); }
  };
  using Geom = std::unique_ptr<dxGeom, Ends>;

  void AddLink(std::size_t dof, double mass_factor);
  void AddJoint(std::size_t dof, double torque_max_nm);
  void AddContacts();
  /// Of a joint, from its links; but for whole turns.
  static double AngleOf(const Joint& joint);
  static double VelocityOf(const Joint& joint);

  PlanarRobot robot_;
  DriveGains gains_;
  double step_s_;
  std::vector<double> start_;
  std::unique_ptr<dxWorld, Ends> world_;
  std::unique_ptr<dxJointGroup, Ends> contacts_;
  std::vector<dBodyID> bodies_;  ///< By degree of freedom; null where it moves none.
  std::vector<Joint> joints_;
  std::vector<Geom> shapes_, ground_;
  dSurfaceParameters surface_{};
  double pitch_rad_ = 0;  ///< May be more than half a turn.
  double time_s_ = 0;
};

}  // namespace tumbler::testing

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "offline/problem/simulated_motion.h"

namespace tumbler::testing {

/// A physics engine that others wrote, with the robot in it and with contacts of its own. Drives
/// obey ctrl - kp q - kd q', within the joint's limit.
class Engine {
 public:
  virtual ~Engine() = default;

  /// Puts the robot where the motion starts, at time zero.
  virtual void Begin() = 0;
  /// Goes on to a time, with what each drive is told until then.
  virtual void PlayTo(double time_s, const std::vector<double>& ctrl) = 0;
  /// Where a joint is, or one of the root's coordinates x, z and pitch.
  [[nodiscard]] virtual double Position(const std::string& joint) const = 0;
};

/// A shipped motion, with the setpoints that tumbler export writes of it: what a user of another
/// engine has.
class PlayedMotion {
 public:
  /// @param file  in primitives/.
  explicit PlayedMotion(const std::string& file, int cycles = 1);

  [[nodiscard]] const SimulatedMotion& motion() const { return motion_; }
  [[nodiscard]] const DriveGains& gains() const { return gains_; }

  /// Plays it, and looks at the root at the end of the hold after each of its motions.
  /// @returns  empty when the robot is where each motion's plan ends: its pitch within 0.15 rad,
  /// and its root's height within 30 mm. Else the motion after which it is not.
  [[nodiscard]] std::string Play(Engine& engine) const;

 private:
  struct Row {
    double time_s = 0;
    std::string node;
    std::vector<double> ctrl;
  };
  static std::vector<Row> ParseCsv(const std::string& text, std::size_t joints);

  SimulatedMotion motion_;
  DriveGains gains_;
  std::vector<Row> rows_;
};

/// Factors of a robot that is not the model, and of its ground.
struct RobotFactors {
  double mu = 1, stiffness = 1, damping = 1;
  std::vector<double> masses;  ///< Of the links, root first, each with its inertia.
};
/// Of the hundred robots of the document's tables.
inline constexpr std::uint64_t kDocumentedRobots = 100;
/// A hundred robots, the same each time with a seed: the links' masses are 5 % off, the ground's
/// friction, stiffness and damping 20 % (standard deviations).
std::vector<RobotFactors> AHundredRobots(int links, std::uint64_t seed = kDocumentedRobots);

/// A motion of primitives/, and how many of its cycles are played.
struct Shipped {
  const char* file;
  int cycles;
};
/// Those that are for robots that differ from the model.
std::span<const Shipped> ShippedMotions();
std::span<const Shipped> ShippedGaits();

/// A cell of a table: "yes", or on which of several grounds a robot is not where it should be.
/// @param amiss  of each ground its name, and what PlayedMotion::Play returns there.
std::string CellOf(const std::vector<std::pair<std::string, std::string>>& amiss);

/// Compares a table of docs/other-simulators.md with what comes of motions that are played.
/// @param source  the test that the table is from.
/// @param heads   of the columns after the motion's name.
/// @param cells   of a motion, as many as there are heads.
void ExpectDocumented(std::span<const Shipped> all, const std::string& source,
                      const std::string& name, const std::vector<std::string>& heads,
                      const std::function<std::vector<std::string>(const PlayedMotion&)>& cells);

}  // namespace tumbler::testing

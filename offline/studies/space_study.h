#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "common/files/primitive_toml.h"
#include "common/files/purpose.h"
#include "common/files/share.h"
#include "offline/certify/space_trial.h"
#include "offline/scene/variation.h"

namespace tumbler {

/// How many robots in space that are not the model a motion serves.
struct SpaceStudy {
  std::string motion;  ///< Primitive or sequence file.
  int cycles = 0;      ///< Of a sequence.
  std::string branch;  ///< That a sequence takes once they are done.
  int robots = 1000;
  std::uint64_t seed = 1;
  double scale = 1;  ///< Multiplies every spread.
  Spreads spreads;
  /// How long robots are watched after the last target of the task [s]: what it asks for at the end
  /// of the settle phase they have to keep until then.
  double hold_s = 0;
  /// Pushes each robot for 0.1 s at its root, level and from any side, at a random time in the hold
  /// [N]. Needs a hold of 1 s or more.
  double push_n = 0;
  /// With which setpoints change [s]. Eight motors share a bus at 400 Hz, twelve at 290 Hz.
  double period_s = 2.5e-3;
  int threads = 1;
  std::atomic<bool>* interrupt = nullptr;
  std::function<void(int)> progress;  ///< Told how many robots are known.
};

/// A motion of those that each robot plays.
struct StudiedMotion {
  std::string name;         ///< Of its node.
  int cycle = 0;            ///< In which of a sequence's cycles it is, from 1.
  std::size_t targets = 0;  ///< How many of SpaceTrial::purpose are its.
};

struct SpaceStudyResult {
  SpaceStudy study;
  DriveGains gains;
  std::vector<StudiedMotion> motions;
  std::vector<SpaceTrial> trials;  ///< Robot by robot; fewer than asked for where interrupted.
  /// In what each of them differs from the model (RobotVariation::deviates).
  std::vector<std::vector<RobotVariation::Deviate>> deviates;

  /// What became of a robot in words; empty where all motions are as asked.
  [[nodiscard]] std::string ReasonOf(const SpaceTrial& trial) const;
  /// Of the robots that were judged, those on which all motions are as asked.
  [[nodiscard]] Share share() const;
  /// How many robots were not judged: a heading that was asked for was none.
  [[nodiscard]] int Unjudged() const;
  /// How many robots fail in each of the motions. They are not played on from there.
  [[nodiscard]] std::vector<int> FailedIn() const;
  struct Missed {
    std::size_t motion = 0;
    std::string of;  ///< The target's name.
    int robots = 0;
  };
  /// How many robots miss each target, of those that come to its motion.
  [[nodiscard]] std::vector<Missed> MissedTargets() const;
};

/// Plays a motion, or all motions of a sequence after each other, on robots that differ from the
/// model, through drives that give way and on a bus that is as slow as its motors make it
/// (PlayThroughDrivesInSpace), and judges each by the primitives' purposes (TryInSpace). No
/// protocol, no executor and no bus is simulated.
/// @throws std::invalid_argument  about a spread that robots in space do not have, or a task that
/// asks for nothing.
SpaceStudyResult RunSpaceStudy(const SpaceStudy& study);

/// Whether a file is a primitive of a robot in space, or a sequence of such.
bool IsMotionInSpace(const std::string& path);

std::string ToText(const SpaceStudyResult& result);
Json ToJson(const SpaceStudyResult& result);

}  // namespace tumbler

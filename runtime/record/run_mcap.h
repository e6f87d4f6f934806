#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <tumbler/event_t.hpp>
#include <tumbler/run_t.hpp>
#include <tumbler/space_truth_t.hpp>
#include <tumbler/state_t.hpp>

#include "runtime/record/mcap_writer.h"
#include "runtime/record/robot_picture.h"

namespace tumbler {

/// A run to be written.
struct RunMcapConfig {
  std::vector<std::string> joints;  ///< In the order of the states.
  McapWriter::Texts about;          ///< For people: motion, bus, ...
  /// Whether the drives are imagined, as in a dry run: then nothing was measured.
  bool imagined_drives = false;
  std::optional<RobotPicture> robot;
  /// On what the measured robot's root is taken to be, as no sensor tells it.
  enum class Root : std::uint8_t { kUnknown, kPlanned, kTrue } root = Root::kUnknown;
};

/// Writes a run as MCAP for Foxglove and PlotJuggler (docs/foxglove.md has topics and frames). What
/// was not measured is not written: the frames of the measured robot are there from the first tick
/// on in which every joint has replied once, and following errors where a setpoint was answered.
///
/// Times are those at which a message was logged [ns]: since 1970, or since the start of a run in
/// virtual time.
class RunMcap {
 public:
  /// @param file  has to outlive this, and knows of failures.
  RunMcap(const RunMcapConfig& config, OutputFile& file);

  void Take(std::uint64_t time_ns, const state_t& state);
  void Take(std::uint64_t time_ns, const event_t& event);
  void Take(std::uint64_t time_ns, const run_t& run);
  /// Of either kind.
  void Take(std::uint64_t time_ns, const space_truth_t& truth);
  void TakePlan(std::uint64_t time_ns, const PictureRoot& root, const std::vector<double>& joints);

  /// Writes what comes after the last message.
  void Finish() { file_.Finish(); }

 private:
  /// What following errors are found from.
  struct AskedTick {
    std::int64_t tick = 0;
    bool controlled = false;
    std::vector<double> limited_rad;
  };

  /// The channel of a topic, which is made when it is first asked for.
  McapWriter::Channel ChannelOf(const std::string& topic, const std::string& type);
  void TakeMeasured(std::uint64_t time_ns, const state_t& state);
  [[nodiscard]] double FollowingError(const state_t& state, std::size_t joint) const;
  /// Draws the robot in the frames with this prefix, once.
  void Draw(std::uint64_t time_ns, const std::string& prefix, const SceneColor& color);
  /// The frames of the links that joints move.
  /// @param root_prefix  of the root.
  /// @param elsewhere    of a link that carries another one, and has no position here.
  /// @param joints       of those without a position the frames are left out.
  void AppendLinks(const std::string& prefix, const std::string& root_prefix,
                   const std::string& elsewhere, const std::vector<std::optional<double>>& joints,
                   std::vector<FrameTransform>& transforms) const;
  void TakeRobot(std::uint64_t time_ns, const std::string& prefix, const PictureRoot& root,
                 const std::vector<std::optional<double>>& joints, const SceneColor& color);

  RunMcapConfig config_;
  McapWriter file_;
  std::map<std::string, std::string> descriptors_;  ///< By package.
  std::map<std::string, McapWriter::Schema> schemas_;
  std::map<std::string, McapWriter::Channel> channels_;
  std::map<std::string, bool> drawn_;
  std::deque<AskedTick> asked_;
  bool replied_ = false;  ///< Whether every joint has replied once.
};

}  // namespace tumbler

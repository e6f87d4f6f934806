#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "offline/pages/view_feed.h"
#include "offline/pages/viewed_robot.h"

namespace tumbler {

/// The two requests that a viewer can send. Neither begins a motion.
enum class EndRequest : std::uint8_t {
  kStop,    ///< Brake at once within the limits, hold, then torque off.
  kDisarm,  ///< Torque off at once.
};

/// A thread that listens to a run by LCM, and publishes what the page shows 25 times a second, also
/// while nothing is heard. It sends nothing but an EndRequest when it is asked to, as tumbler ctl
/// does: to every run of the robot that is heard, again and again for 2 s until the run answers.
///
/// It follows one run until that was silent for a second, and then the next one.
class LiveRun {
 public:
  /// @param robot_name  follows only runs of this robot; empty: of any, as long as only one robot
  ///                    publishes.
  /// @param robot       null: without a picture.
  /// @param feed        must outlive this object.
  /// @throws std::runtime_error when LCM cannot use the URL, or nobody answers there.
  LiveRun(const std::string& url, const std::string& robot_name, std::unique_ptr<ViewedRobot> robot,
          ViewFeed& feed);
  ~LiveRun();
  LiveRun(const LiveRun&) = delete;
  LiveRun& operator=(const LiveRun&) = delete;

  /// Asks the run that is shown to end. What became of it is in the next texts of the feed.
  /// @param run  the number of the run that was on the page, as a text; of another one nothing is
  ///             asked.
  /// @returns why nothing was sent; empty: it is being sent.
  std::string Ask(EndRequest request, const std::string& run);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace tumbler

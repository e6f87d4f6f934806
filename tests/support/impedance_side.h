#pragma once

#include <cmath>
#include <memory>
#include <variant>

#include "firmware_interface/devices/impedance.h"
#include "tests/support/codec_check.h"
#include "tests/support/protocol_side.h"

namespace tumbler::testing {

/// The value of a code, of a range that so many steps cover.
inline double ValueOfCode(unsigned code, const DriveRange& range, double steps) {
  return static_cast<double>(range.min) + code * static_cast<double>(range.max - range.min) / steps;
}

/// Watches a drive whose setpoints carry gains.
class ImpedanceWatch : public DriveWatch {
 public:
  using DriveWatch::DriveWatch;

 protected:
  /// Judges a setpoint: without gains and torque it is passive.
  void TakeOrder(const DriveOrder& order, double time_s) {
    const WireSteps& steps = joint().steps();
    const bool drives =
        order.kp_nm_per_rad > 0 || std::abs(order.torque_nm) > steps.torque_nm ||
        (order.kd_nm_s_per_rad > 0 && std::abs(order.velocity_rad_s) > steps.velocity_rad_s);
    if (drives) {
      joint().Setpoint(order, time_s);
    } else {
      joint().Passive(order);
    }
  }
};

/// What the test sides of protocols have in common whose setpoints carry gains, in one frame.
/// @tparam Config  of a drive.
/// @tparam Watcher  its watch, made from such a configuration and a joint's judge.
template <typename Config, typename Watcher>
class ImpedanceSide : public ProtocolSide {
 public:
  [[nodiscard]] ProtocolNature nature() const override {
    ProtocolNature nature;
    nature.carries_gains = true;
    nature.clears_errors = false;
    nature.latches_watchdog = false;
    nature.follows_in_error = true;
    return nature;
  }
  [[nodiscard]] std::unique_ptr<DriveWatch> Watch(const DriveConfig& drive,
                                                  JointJudge& joint) const final {
    return std::make_unique<Watcher>(Of(drive), joint);
  }
  void SpoilTorque(CanFrame& frame) const final {
    frame.data[6] = static_cast<std::uint8_t>(frame.data[6] | 0x0fU);
  }

 protected:
  static const Config& Of(const DriveConfig& drive) { return std::get<Config>(drive); }

  /// @param fewer  by how many steps a range has fewer than codes.
  static WireSteps StepsOfRanges(const ImpedanceRanges& ranges, int fewer) {
    const auto step = [fewer](const DriveRange& range, int bits) {
      return static_cast<double>(range.max - range.min) / ((1 << bits) - fewer);
    };
    return {step(ranges.position_rad, 16), step(ranges.velocity_rad_s, 12),
            step(ranges.torque_nm, 12)};
  }

  /// Adds a setpoint, as `encode` packs and `decode` unpacks it.
  template <typename Encode, typename Decode>
  static void AddSetpoint(FrameSamples& samples, const char* name, const Encode& encode,
                          const Decode& decode) {
    ImpedanceCommand command{samples.Number(-14, 14), samples.Number(-70, 70),
                             samples.Number(0, 520), samples.Number(0, 5.2F),
                             samples.Number(-19, 19)};
    const CanFrame sent = encode(command);
    FrameSamples::Expect(decode(sent, command));
    samples.Add(name, sent,
                {{"position", command.position_rad},
                 {"velocity", command.velocity_rad_s},
                 {"kp", command.kp_nm_per_rad},
                 {"kd", command.kd_nm_s_per_rad},
                 {"torque", command.torque_nm}});
  }
};

}  // namespace tumbler::testing

#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware_interface/devices/cia402.h"
#include "firmware_interface/devices/simulated_drive.h"

namespace tumbler {

/// Properties of a simulated CiA 402 drive. Of `node` only what is a property of the drive is used
/// (number, units, joint); everything else it learns from its host.
struct SimulatedCia402Config : SimulatedMotorConfig {
  Cia402Config node;
  /// Gains of its position loop, at the shaft: torque = kp (target - q) + kd (velocity offset -
  /// qdot) + torque offset.
  double kp_nm_per_rad = 200;
  double kd_nm_s_per_rad = 4;
  double sync_timeout_s = 0.02;     ///< No SYNC for so long is a fault while enabled. 0 is off.
  double following_window_rad = 1;  ///< 6065h at power-on, at the shaft; 0 is off.
};

/// The drive side of CiA 402 in cyclic synchronous position, with as much of CiA 301 as its host
/// uses.
///
/// - The object dictionary refuses unknown objects, wrong sizes, values that make no sense, and
///   changes of PDOs that exist. It is forgotten in a reset. PDOs are packed and unpacked as they
///   are mapped.
/// - PDOs are synchronous: the drive acts on an RPDO at the next SYNC, and sends TPDOs after a
///   SYNC. The target is interpolated linearly over the period of 60C2h.
/// - The controlword drives the power state machine; the fault reset is an edge. In a fault the
///   drive brakes (kd only) until the joint rests or kFaultReaction_s are over, and then takes the
///   torque away.
/// - The drive sends heartbeats, a boot-up message, and EMCY on a fault and its reset. It watches
///   the host's heartbeat, the time between SYNCs, and the following error with its window.
class SimulatedCia402Drive final : public SimulatedDrive {
 public:
  static constexpr double kFaultReaction_s = 0.2;

  /// @throws std::invalid_argument  naming the value that is not allowed.
  explicit SimulatedCia402Drive(const SimulatedCia402Config& config);

  void OnFrame(const ReceivedFrame& received, SimulatedPort& port) noexcept override;

  [[nodiscard]] bool enabled() const noexcept override {
    return state_ == Cia402State::kEnabled || state_ == Cia402State::kQuickStop ||
           state_ == Cia402State::kFaultReaction;
  }
  [[nodiscard]] std::int64_t next_act_ns() const noexcept override {
    return heartbeat_ms_ == 0 ? kNever : heartbeat_due_ns_;
  }
  [[nodiscard]] bool limp() const noexcept override { return error_code_ == kEmergencyHeartbeat; }
  [[nodiscard]] std::optional<double> target_rad() const noexcept override;
  /// Raises a fault with this EMCY code.
  void RaiseError(std::uint32_t code) noexcept override;

  [[nodiscard]] Cia402State state() const noexcept { return state_; }
  [[nodiscard]] NmtState nmt_state() const noexcept { return nmt_; }
  [[nodiscard]] const SimulatedCia402Config& config() const noexcept { return config_; }
  /// Switches the drive off and on again: it boots, and has forgotten its set-up.
  void PowerCycle() noexcept;
  /// Makes the drive refuse every write to this object, like a drive that does not have it.
  void Refuse(std::uint16_t index) noexcept { refused_index_ = index; }

 private:
  static constexpr std::size_t kPdoEntries = 4;
  /// A PDO's communication and mapping parameters.
  struct Pdo {
    std::uint32_t id = 0;
    bool exists = false;
    std::uint8_t type = 0;
    std::uint8_t count = 0;
    std::array<std::uint32_t, kPdoEntries> entries{};
    bool pending = false;  // RPDO: whether `received` came since the last SYNC
    CanFrame received;
    int syncs = 0;  // TPDO: SYNCs since the last transmission
  };
  /// An object of the dictionary: its value, and its bytes on the wire.
  struct Object {
    std::int64_t value = 0;
    std::uint8_t size = 0;  // 0: there is no such object
  };

  [[nodiscard]] SimulatedPortConfig port_config() const noexcept override;
  void Act(std::int64_t time_ns) noexcept override;
  [[nodiscard]] double Law(std::int64_t time_ns, const Shaft& shaft) const noexcept override;
  [[nodiscard]] double TargetAt(std::int64_t time_ns) const noexcept;

  void Boot() noexcept;
  void Answer(const SdoRequest& request, SimulatedPort& port) noexcept;
  std::uint32_t Write(const SdoRequest& request) noexcept;  // returns the abort code, or 0
  std::uint32_t WritePdo(Pdo& pdo, bool mapping, const SdoRequest& request) noexcept;
  std::uint32_t WriteValue(std::uint16_t index, std::uint8_t sub, std::uint8_t size,
                           std::uint32_t value) noexcept;
  [[nodiscard]] Object Read(std::uint16_t index, std::uint8_t sub) const noexcept;
  Pdo* PdoAt(std::uint16_t index, bool& mapping) noexcept;
  void OnSync(SimulatedPort& port) noexcept;
  void OnNmt(NmtCommand command) noexcept;
  void OnControlword(std::uint16_t controlword) noexcept;
  void Fault(std::uint16_t code) noexcept;
  void CheckTimeouts() noexcept;
  [[nodiscard]] double FromPositionUnits(std::int32_t units) const noexcept;
  [[nodiscard]] std::int32_t position_units() const noexcept;
  [[nodiscard]] std::uint16_t statusword() const noexcept;

  SimulatedCia402Config config_;
  std::int64_t now_ns_ = 0;
  bool booted_ = false;
  NmtState nmt_ = NmtState::kPreOperational;
  std::array<Pdo, 2> rpdo_;
  std::array<Pdo, 2> tpdo_;
  std::uint16_t refused_index_ = 0;

  // Objects.
  std::uint16_t heartbeat_ms_ = 0;
  std::uint32_t consumer_ = 0;
  std::uint32_t sync_period_us_ = 0;
  std::int16_t connection_option_ = 1;
  std::int16_t quick_stop_option_ = 2;
  std::uint8_t period_value_ = 1;
  std::int8_t period_exponent_ = -2;
  std::int8_t mode_ = 0;
  std::uint32_t window_ = 0;
  std::uint16_t controlword_ = 0;
  std::int32_t target_ = 0;
  std::int32_t velocity_offset_ = 0;
  std::int16_t torque_offset_ = 0;

  Cia402State state_ = Cia402State::kSwitchOnDisabled;
  std::uint16_t error_code_ = 0;
  bool following_error_ = false;
  std::int64_t heartbeat_due_ns_ = 0;
  bool host_seen_ = false;  // whether the host's heartbeat ever came: then it is watched
  std::int64_t host_ns_ = 0;
  std::int64_t sync_ns_ = 0;
  std::int64_t reaction_end_ns_ = 0;
  double target_rad_ = 0;             // target of the position loop, at the shaft
  double from_rad_ = 0, to_rad_ = 0;  // interpolation, at the shaft
};

}  // namespace tumbler

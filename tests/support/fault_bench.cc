#include "tests/support/fault_bench.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace tumbler::testing {

FrameRules FaultBench::RulesOf(const Config& config) {
  FrameRules rules;
  rules.drives = config.drives;
  rules.exact_time = true;
  rules.spoilt_replies = config.spoilt_replies;
  rules.ticks_made_up_max = 1 + config.executor.late_ticks_max;
  rules.torque_rise_s = static_cast<double>(config.executor.torque_rise_s);
  for (std::size_t i = 0; i < config.drives.drives.size(); ++i) {
    // The widest limits of all paths that the joint may follow.
    JointLimits<double> all;
    all.position_min_rad = 1e9;
    all.position_max_rad = -1e9;
    for (const Primitive<float>& primitive : config.primitives) {
      for (const std::size_t role : {i, std::size_t{config.graph.partner[i]}}) {
        const JointLimits<float>& limits = primitive.joints[role].limits;
        const auto wide = [](float x) { return static_cast<double>(x); };
        all.position_min_rad = std::min(all.position_min_rad, wide(limits.position_min_rad));
        all.position_max_rad = std::max(all.position_max_rad, wide(limits.position_max_rad));
        all.velocity_max_rad_s = std::max(all.velocity_max_rad_s, wide(limits.velocity_max_rad_s));
        all.torque_max_nm = std::max(all.torque_max_nm, wide(limits.torque_max_nm));
      }
    }
    rules.limits.push_back(all);
  }
  return rules;
}

FaultBench::FaultBench(Config config)
    : bus(config.drives.bit_rate),
      host([this, &config]() -> SimulatedPort& {
        SimulatedPortConfig port;
        port.transmit_capacity = config.transmit_capacity;
        return bus.Attach(port);
      }()),
      stranger([this, &config]() -> SimulatedPort& {
        for (const DriveEntry& entry : config.drives.drives) {
          drives.push_back(MakeSimulatedDrive(entry));
          drives.back()->AttachTo(bus);
        }
        SimulatedPortConfig port;
        port.receive_capacity = 1;
        return bus.Attach(port);
      }()),
      judge(RulesOf(config)),
      config_(std::move(config)),
      period_ns_(static_cast<std::int64_t>(std::llround(1e9 / config_.drives.rate_hz))) {
  std::vector<RotorPlant::Rotor> rotors;
  const SequenceGraph<float>& graph = config_.graph;
  const Primitive<float>& first =
      config_.primitives.at(static_cast<std::size_t>(graph.node(graph.start).primitive));
  for (std::size_t i = 0; i < drives.size(); ++i) {
    if (bank_.Add(config_.drives.drives[i].config) != Status::kOk) {
      throw std::invalid_argument("a drive cannot be used as configured");
    }
    const auto role = static_cast<std::size_t>(graph.RoleOf(graph.start, static_cast<int>(i)));
    RotorPlant::Rotor rotor;
    rotor.drive = drives[i].get();
    rotor.position_rad =
        static_cast<double>(first.joints[role].position.control_points()[0]) + config_.offset_rad;
    rotors.push_back(rotor);
  }
  plant = std::make_unique<RotorPlant>(bus, std::move(rotors), config_.plant_step_ns);
  received_.reserve(512);
  configured =
      executor.Configure(config_.executor, config_.graph, config_.primitives, bank_.drives());
}

void FaultBench::Judge(std::int64_t time_ns, const CanFrame& frame) {
  // Times begin at 1 s, because a time of zero stands for none.
  const LoggedFrame logged{1.0 + static_cast<double>(time_ns) * 1e-9, frame};
  judge.Take(logged);
  if (keep_log) log.push_back(logged);
}

const TickRecord& FaultBench::Tick(OperatorCommand command, std::int8_t branch) {
  plant->AdvanceTo(now_ns());
  if (before_tick) before_tick();
  received_.clear();
  ReceivedFrame received;
  Status status = Status::kOk;
  while (received_.size() < 512 && (status = host.Receive(received)) == Status::kOk) {
    received_.push_back(received);
    // The judge takes every command for the host's.
    const bool of_stranger = std::ranges::any_of(bank_.drives(), [&received](const Drive* drive) {
      return drive->IsCommand(received.frame);
    });
    if (!of_stranger) Judge(now_ns(), received.frame);
  }
  TickInput input;
  input.tick = tick_;
  input.time_ns = now_ns();
  input.received = received_;
  input.receive_status = receive_status.value_or(status);
  input.send_status = send_status_;
  input.command = command;
  input.branch = branch;
  input.controller = host.controller_state();
  if (enter_loop != nullptr) enter_loop();
  executor.Tick(input, output);
  send_status_ = Status::kOk;
  for (std::size_t i = 0; i < drives.size(); ++i) {
    for (const CanFrame& frame : output.frames[i].frames()) {
      if (send_status_ == Status::kOk) send_status_ = host.Send(frame);
    }
  }
  if (leave_loop != nullptr) leave_loop();
  for (std::size_t i = 0; i < drives.size(); ++i) {
    const auto frames = output.frames[i].frames();
    // SYNC and the host's heartbeat are for all drives.
    const auto to_drive = std::ranges::count_if(frames, [](const CanFrame& frame) {
      return frame.extended || (frame.id != 0x80 && frame.id < 0x700);
    });
    if (to_drive == 0) ++missing_writes;
    for (const CanFrame& frame : frames) {
      Judge(now_ns(), frame);
      if (on_sent) on_sent(frame);
    }
  }
  ++tick_;
  return output.record;
}

bool FaultBench::TickUntil(ExecutorState state, int ticks_max) {
  for (int i = 0; i < ticks_max && executor.state() != state; ++i) Tick();
  return executor.state() == state;
}

bool FaultBench::Reach(ExecutorState state) {
  // CANopen drives are set up first, one object a tick or so.
  int heard = 0;
  for (int i = 0; i < 1000 && heard < 3; ++i) {
    const TickRecord& record = Tick();
    bool all = true;
    for (std::size_t j = 0; j < drives.size(); ++j) {
      all = all && record.joints[j].reply_age_ticks >= 0 &&
            record.joints[j].drive_state == DriveState::kDisabled;
    }
    heard = all ? heard + 1 : 0;
  }
  if (heard < 3) return false;
  if (state == ExecutorState::kDisarmed) return true;
  Tick(OperatorCommand::kArm);
  if (state == ExecutorState::kArming) return executor.state() == state;
  if (!TickUntil(ExecutorState::kHolding, 500)) return false;
  for (int i = 0; i < 100; ++i) Tick();  // until the feed-forward's first push has died away
  if (state == ExecutorState::kHolding) return executor.state() == state;
  if (state == ExecutorState::kFault) {
    Miss(1 + config_.executor.late_ticks_max);  // This is shorter than any watchdog.
    Tick();
    return executor.state() == state;
  }
  Tick(OperatorCommand::kMoveToStart);
  for (int i = 0; i < 3; ++i) Tick();
  if (state == ExecutorState::kMovingToStart) return executor.state() == state;
  if (!TickUntil(ExecutorState::kHolding, 5000)) return false;
  for (int i = 0; i < 100; ++i) Tick();
  Tick(OperatorCommand::kRun);
  for (std::int64_t i = 0; i < executor.run_ticks() / 3; ++i) Tick();
  if (state == ExecutorState::kRunning) return executor.state() == state;
  if (state == ExecutorState::kStopping) {
    Tick(OperatorCommand::kStop);
    return executor.state() == state;
  }
  return state == ExecutorState::kSettling && TickUntil(state, 5000);
}

void FaultBench::Disturb(BusFault fault, std::int64_t duration_ns) {
  std::erase_if(plan_.faults, [this](const BusFault& old) { return old.end_ns < bus.now_ns(); });
  ++plan_.seed;  // With the same seed the random numbers would begin anew each time.
  fault.start_ns = now_ns();
  fault.end_ns = fault.start_ns + duration_ns;
  plan_.faults.push_back(std::move(fault));
  bus.SetFaults(plan_);
}

}  // namespace tumbler::testing

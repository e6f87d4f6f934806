#include "runtime/bench/bus_scan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <map>
#include <memory>
#include <numbers>
#include <set>

#include "common/files/program.h"
#include "firmware_interface/devices/damiao_registers.h"
#include "firmware_interface/devices/error_texts.h"
#include "runtime/bench/bench_session.h"

namespace tumbler {
namespace {

constexpr std::uint8_t kAxisStateMax = 14;  // of ODrive's AxisState
constexpr int kCanOpenDriveMax = 126;

/// Protocols with questions and answers of their own in a scan.
template <typename Protocol>
constexpr bool kHasOwnQuestions =
    std::same_as<Protocol, MitProtocol> || std::same_as<Protocol, Cia402Protocol> ||
    std::same_as<Protocol, CanSimpleProtocol>;

/// A drive of any other protocol that may be on the bus: the host's order for torque off asks for
/// it.
struct Candidate {
  std::string_view protocol;
  std::string_view error_codes;
  int number = 0;
  std::unique_ptr<Drive> host;
};

std::vector<Candidate> AllCandidates() {
  std::vector<Candidate> all;
  DriveProtocols::ForEach([&all](auto listed) {
    using Protocol = decltype(listed);
    if constexpr (!kHasOwnQuestions<Protocol>) {
      for (int number = 0; number <= 0xff; ++number) {
        const auto config = OfNode<typename Protocol::Config>(number);
        all.push_back({Protocol::kName, ErrorCodesOf(config), number,
                       std::make_unique<typename Protocol::Host>(config)});
      }
    }
  });
  return all;
}

class Scanner {
 public:
  Scanner(BenchWorld& world, const ScanConfig& config)
      : world_(world), config_(config), candidates_(AllCandidates()) {}

  std::vector<FoundDrive> Run() {
    Listen(config_.listen_s);
    for (auto& [key, drive] : found_) drive.by_itself = true;
    if (!config_.passive) {
      RefuseForeign();
      for (int round = 0; round < config_.rounds; ++round) AskAll();
    }
    std::vector<FoundDrive> drives;
    for (const auto& [key, drive] : found_) {
      drives.push_back(drive);
      if (ShouldSpeakByItself(drive) && !drive.by_itself)
        drives.back().details += ", silent until it is asked: set it to periodic feedback";
    }
    return drives;
  }

 private:
  using Key = std::pair<std::string, int>;
  /// Whom the questions are for. A reply of an MIT drive can look like any other message.
  enum class Phase : std::uint8_t { kListen, kCanSimple, kCanOpen, kMit, kCandidates };

  void AskAll() {
    AskNodes();
    AskMit();
    AskCandidates();
    constexpr double kLast_s = 0.05;
    Listen(kLast_s);
    phase_ = Phase::kListen;
  }

  void AskNodes() {
    phase_ = Phase::kCanSimple;
    for (int node = 0; node <= kCanSimpleNodeMax; ++node) {
      if (Has(CanSimpleProtocol::kName, node) || IsTaken(node << 5 | 0x09)) continue;
      CanFrame ask;
      ask.id = CanSimpleId(static_cast<std::uint8_t>(node), CanSimpleCommand::kGetEncoderEstimates);
      ask.remote = true;
      ask.size = 8;
      Ask(ask);
    }
    phase_ = Phase::kCanOpen;
    for (int node = 1; node <= kCanOpenDriveMax; ++node) {
      if (types_.count(node) != 0 || IsTaken(static_cast<int>(canopen_id::kSdoRequest) + node))
        continue;
      SdoRequest request;
      request.write = false;
      request.index = 0x1000;
      Ask(EncodeSdoRequest(static_cast<std::uint8_t>(node), request));
    }
  }

  void AskMit() {
    phase_ = Phase::kMit;
    for (int id = config_.mit_first; id <= config_.mit_last; ++id) {
      if (Has(MitProtocol::kName, id) || IsTaken(id)) continue;
      MitConfig drive;
      drive.command_id = static_cast<std::uint16_t>(id);
      mit_asked_.insert(id);
      last_asked_ = id;
      Ask(MitMagicFrame(drive, MitMagic::kExit));
    }
    constexpr double kLate_s = 0.05;
    Listen(kLate_s);
    for (const auto& [asked, frame] : std::move(unclear_)) {
      if (!Has(MitProtocol::kName, asked) && AskRegister(asked)) {
        NoteMit(asked, frame).damiao = true;
      } else if (mit_asked_.count(frame.data[0]) != 0 && !IsRegister(frame)) {
        NoteMit(frame.data[0], frame);
      }
    }
    unclear_.clear();
    for (auto& [key, drive] : found_) {
      if (drive.protocol == MitProtocol::kName && !drive.damiao)
        drive.damiao = AskRegister(drive.number);
    }
  }

  void AskCandidates() {
    phase_ = Phase::kCandidates;
    for (const Candidate& candidate : candidates_) {
      const int number = candidate.number;
      const bool asked = number >= config_.mit_first && number <= config_.mit_last;
      if (!asked || Has(candidate.protocol, number)) continue;
      FrameBatch off;
      if (candidate.host->Encode(DriveRequest::kDisable, {}, off) != Status::kOk) continue;
      for (const CanFrame& frame : off.frames()) {
        if (frame.extended || !IsTaken(static_cast<int>(frame.id))) Ask(frame);
      }
    }
  }
  /// Whether a drive is of a protocol whose drives send without being asked.
  [[nodiscard]] bool ShouldSpeakByItself(const FoundDrive& drive) const {
    return std::ranges::any_of(candidates_, [&drive](const Candidate& candidate) {
      return candidate.protocol == drive.protocol && !candidate.host->reply_rhythm().answers;
    });
  }

  /// Asks for a register that only Damiao's drives have. @returns whether the drive answered.
  bool AskRegister(int id) {
    register_of_.reset();
    DamiaoRegister of;
    of.drive = static_cast<std::uint16_t>(id);
    of.number = kDamiaoCommandId;
    Ask(EncodeDamiao(kDamiaoRegistersId, of));
    return register_of_ == id;
  }
  static bool IsRegister(const CanFrame& frame) {
    DamiaoRegister of;
    return DecodeDamiao(frame, of) && of.number == kDamiaoCommandId && of.value == of.drive;
  }

  [[nodiscard]] bool Has(std::string_view protocol, int number) const {
    return found_.count({std::string(protocol), number}) != 0;
  }
  /// Whether an identifier is one of a node that was found, so that no other question may use it.
  [[nodiscard]] bool IsTaken(int id) const {
    for (const auto& [key, drive] : found_) {
      if (drive.protocol == CanSimpleProtocol::kName && id >> 5 == drive.number) return true;
      if (drive.protocol == Cia402Protocol::kName && id >= 0x80 && (id & 0x7f) == drive.number)
        return id < static_cast<int>(canopen_id::kSdoRequest);
    }
    return id == static_cast<int>(canopen_id::kNmt) || id == static_cast<int>(canopen_id::kSync);
  }

  void Ask(const CanFrame& frame) {
    constexpr int kTries = 100;  // of 2 ms: longer than a bus that works keeps anybody waiting
    for (int attempt = 0; attempt < kTries; ++attempt) {
      const Status status = world_.bus().Send(frame);
      Listen(config_.patience_s);
      if (status == Status::kOk) return;
      if (status != Status::kWouldBlock)
        throw BenchFault(fmt::format("the bus is lost: {}", ToString(status)));
    }
    throw Refused(
        "nobody acknowledges: is a drive switched on, does the bit rate agree, and is the bus "
        "terminated?");
  }

  void Listen(double time_s) {
    const std::int64_t end_ns = world_.clock().now_ns() + std::llround(time_s * 1e9);
    constexpr std::int64_t kGlance_ns = 10'000'000;
    do {
      EndWhereAsked();
      world_.clock().SleepUntil(std::min(world_.clock().now_ns() + kGlance_ns, end_ns));
      ReceivedFrame received;
      Status status = Status::kOk;
      while ((status = world_.bus().Receive(received)) == Status::kOk) Take(received.frame);
      if (status != Status::kWouldBlock)
        throw BenchFault(fmt::format("the bus is lost: {}", ToString(status)));
    } while (world_.clock().now_ns() < end_ns);
  }

  FoundDrive& Note(std::string_view protocol, int number) {
    FoundDrive& drive = found_[{std::string(protocol), number}];
    drive.protocol = protocol;
    drive.number = number;
    return drive;
  }

  void Take(const CanFrame& frame) {
    if (frame.remote) return;
    if ((frame.extended || phase_ == Phase::kCandidates) && TakeCandidate(frame)) return;
    if (frame.extended) return SuspectCommand(frame);
    if (TakeCanOpen(frame) || TakeCanSimple(frame) || TakeMit(frame)) return;
    // What is heard unasked, and is none of the messages that drives send by themselves.
    const bool setpoint = frame.size == 8 && frame.id >= 1 && frame.id <= 0xff;
    if (phase_ == Phase::kListen && mit_asked_.empty() && setpoint) suspects_.push_back(frame);
  }

  /// Refuses to ask where setpoints were heard: frames that are none of a drive's own messages.
  void RefuseForeign() {
    const std::vector<CanFrame> suspects = std::move(suspects_);
    for (const CanFrame& frame : suspects) {
      if (!frame.extended && (TakeCanOpen(frame) || TakeCanSimple(frame)))
        continue;  // Its node was heard later.
      throw Refused(fmt::format(
          "somebody commands drives on this bus (frame 0x{:0{}x}): end that program first, or only "
          "listen with --passive",
          frame.id, frame.extended ? 8 : 3));
    }
  }

  bool TakeCanOpen(const CanFrame& frame) {
    const auto node = static_cast<std::uint8_t>(frame.id & 0x7f);
    if (node == 0) return frame.id == canopen_id::kSync;
    NmtState state{};
    if (DecodeNodeState(node, frame, state) == Status::kOk && node <= kCanOpenDriveMax) {
      Note(Cia402Protocol::kName, node);
      return true;
    }
    SdoReply reply;
    if (DecodeSdoReply(node, frame, reply) == Status::kOk && reply.index == 0x1000) {
      FoundDrive& drive = Note(Cia402Protocol::kName, node);
      types_.insert(node);
      if (reply.kind == SdoReply::Kind::kRead) {
        const bool drive_profile = (reply.value & 0xffff) == 402;
        drive.details = fmt::format("device type 0x{:08x}, {}", reply.value,
                                    drive_profile ? "a drive" : "not of CiA 402");
      }
      return true;
    }
    return Has(Cia402Protocol::kName, node) && frame.id >= 0x80 && frame.id < 0x780;
  }

  bool TakeCanSimple(const CanFrame& frame) {
    const auto node = static_cast<std::uint8_t>(frame.id >> 5);
    if (node > kCanSimpleNodeMax) return false;
    if (phase_ == Phase::kMit || frame.size != 8) return Has(CanSimpleProtocol::kName, node);
    CanSimpleHeartbeat heartbeat;
    if (DecodeCanSimple(node, frame, heartbeat) == Status::kOk &&
        heartbeat.state <= kAxisStateMax && frame.data[7] == 0) {
      Note(CanSimpleProtocol::kName, node).details =
          fmt::format("axis state {}, error 0x{:x}", heartbeat.state, heartbeat.error);
      return true;
    }
    CanSimpleEstimates estimates;
    if (phase_ == Phase::kCanSimple && DecodeCanSimple(node, frame, estimates) == Status::kOk &&
        std::abs(estimates.position_rev) < 1e6F && std::abs(estimates.velocity_rev_s) < 1e4F) {
      Note(CanSimpleProtocol::kName, node);
    }
    return Has(CanSimpleProtocol::kName, node);
  }

  bool TakeMit(const CanFrame& frame) {
    if (frame.size < 6 || phase_ != Phase::kMit) return false;
    if (IsRegister(frame)) {
      register_of_ = frame.data[0] | frame.data[1] << 8;
      return true;
    }
    const int sender = frame.data[0];
    if (sender == last_asked_) {
      NoteMit(sender, frame);
    } else if (!Has(MitProtocol::kName, sender) || (sender & 0xf) == (last_asked_ & 0xf)) {
      // A late reply, or one that has only the low bits of the identifier.
      unclear_.emplace_back(last_asked_, frame);
    }
    return true;
  }

  /// @returns whether the frame is what one of the candidates measures.
  bool TakeCandidate(const CanFrame& frame) {
    for (const Candidate& candidate : candidates_) {
      if (!candidate.host->Decode(frame)) continue;
      const DriveFeedback said = candidate.host->feedback();
      const std::string error =
          said.error == 0 ? "no error" : DescribeDriveError(candidate.error_codes, said.error);
      Note(candidate.protocol, candidate.number).details = fmt::format(
          "{:.1f} degrees, {}", double{said.position_rad} * 180 / std::numbers::pi, error);
      return true;
    }
    return false;
  }
  void SuspectCommand(const CanFrame& frame) {
    if (phase_ != Phase::kListen || !mit_asked_.empty() || frame.size != 8) return;
    const bool command = std::ranges::any_of(candidates_, [&frame](const Candidate& candidate) {
      return candidate.host->IsCommand(frame);
    });
    if (command) suspects_.push_back(frame);
  }

  FoundDrive& NoteMit(int id, const CanFrame& frame) {
    FoundDrive& drive = Note(MitProtocol::kName, id);
    drive.reply_id = static_cast<int>(frame.id);
    drive.details = fmt::format("{} bytes", frame.size);
    return drive;
  }

  BenchWorld& world_;
  ScanConfig config_;
  std::vector<Candidate> candidates_;
  Phase phase_ = Phase::kListen;
  std::map<Key, FoundDrive> found_;
  std::set<int> types_;      // nodes that told their device type, or refused to
  std::set<int> mit_asked_;  // identifiers
  std::vector<CanFrame> suspects_;
  int last_asked_ = 0;                             // identifier of an MIT drive
  std::vector<std::pair<int, CanFrame>> unclear_;  // what was asked last, and a reply
  std::optional<int> register_of_;                 // the drive that answered for a register
};

}  // namespace

std::vector<FoundDrive> ScanBus(BenchWorld& world, const ScanConfig& config) {
  return Scanner(world, config).Run();
}

std::string Describe(const FoundDrive& drive) {
  std::string text = fmt::format("{} {}", drive.protocol, drive.number);
  if (drive.reply_id) text += fmt::format(", replies on {}", *drive.reply_id);
  if (drive.damiao) text += ", Damiao";
  if (!drive.details.empty()) text += ", " + drive.details;
  if (drive.by_itself) text += ", speaks by itself";
  return text;
}

Json ToJson(const FoundDrive& drive) {
  Json json = {{"protocol", drive.protocol},
               {"number", drive.number},
               {"by_itself", drive.by_itself},
               {"details", drive.details}};
  if (drive.reply_id) json["reply_id"] = *drive.reply_id;
  if (drive.protocol == MitProtocol::kName)
    json["dialect"] = drive.damiao ? "damiao" : "mini-cheetah";
  return json;
}

const FoundDrive* FindDrive(const std::vector<FoundDrive>& found, const DriveEntry& entry) {
  return DriveProtocols::With(entry.config, [&](auto protocol, const auto& config) {
    int number = 0;
    if constexpr (requires { config.command_id; }) {
      number = config.command_id;
    } else {
      number = config.node_id;
    }
    const FoundDrive* match = nullptr;
    for (const FoundDrive& drive : found) {
      if (drive.protocol == decltype(protocol)::kName && drive.number == number) match = &drive;
    }
    return match;
  });
}

}  // namespace tumbler

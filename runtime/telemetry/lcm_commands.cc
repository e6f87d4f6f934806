#include "runtime/telemetry/lcm_commands.h"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <thread>

#include <lcm/lcm-cpp.hpp>

#include "common/say_to_operator.h"
#include "runtime/telemetry/channels.h"
#include "runtime/telemetry/lcm_link.h"

namespace tumbler {

static_assert(command_t::START == static_cast<int>(OperatorRequest::kStart));
static_assert(command_t::BRANCH == static_cast<int>(OperatorRequest::kBranch));
static_assert(command_t::CLEAR_FAULTS == static_cast<int>(OperatorRequest::kClearFaults));
static_assert(command_t::FINISH == static_cast<int>(OperatorRequest::kFinish));
static_assert(command_t::STOP == static_cast<int>(OperatorRequest::kStop));
static_assert(command_t::DISARM == static_cast<int>(OperatorRequest::kDisarm));

bool ReadCommand(std::span<const std::uint8_t> bytes, command_t& message) {
  // Fingerprint, id, run, seen, command and the length of the text, which counts its closing zero.
  constexpr std::size_t kLengthAt = 8 + 8 + 8 + 8 + 1;
  constexpr std::size_t kTextAt = kLengthAt + 4;
  constexpr std::size_t kTextMax = 256;
  if (bytes.size() <= kTextAt || bytes.size() > kTextAt + kTextMax) return false;
  std::size_t length = 0;
  for (std::size_t i = kLengthAt; i < kTextAt; ++i) length = length << 8 | bytes[i];
  if (length != bytes.size() - kTextAt || bytes.back() != 0) return false;
  command_t read;
  const auto size = static_cast<int>(bytes.size());
  if (read.decode(bytes.data(), 0, size) != size) return false;
  message = read;
  return true;
}

struct LcmCommands::Implementation {
  Implementation(const std::string& url, OperatorMailbox& mailbox_in,
                 const SequenceGraph<float>& graph_in, const CommandAddress& address_in)
      : lcm(url), mailbox(mailbox_in), graph(graph_in), address(address_in) {
    if (!lcm.good()) throw std::runtime_error(fmt::format("{}: LCM cannot use this URL", url));
    if (lcm.getFileno() < 0)
      throw std::runtime_error(fmt::format("{}: no LCM server answers there", url));
    // UndefinedBehaviorSanitizer objects to the overload for member functions.
    SubscribeToWholeMessages(
        [this] { lcm.subscribeFunction(kCommandChannel, &Implementation::Handle, this); });
    thread = std::thread([this] {
      constexpr int kPatience_ms = 100;  // the longest that the destructor has to wait
      while (!stop) {
        if (HandleLcm(lcm, kPatience_ms) >= 0) continue;
        // A link that breaks at once again must not keep a processor busy.
        std::this_thread::sleep_for(std::chrono::milliseconds(kPatience_ms));
      }
    });
  }

  static void Handle(const lcm::ReceiveBuffer* buffer, const std::string& channel,
                     Implementation* self) {
    command_t message;
    // LCM matches channels by a regular expression, whose end is before the end of a line, too.
    if (channel != kCommandChannel) return;
    if (!ReadCommand({static_cast<const std::uint8_t*>(buffer->data), buffer->data_size},
                     message) ||
        !self->Take(message)) {
      ++self->unreadable;
    }
  }

  /// @returns false when there is no such request.
  bool Take(const command_t& message) {
    if (message.id < 1 || message.id > std::numeric_limits<std::uint32_t>::max()) return false;
    constexpr std::int64_t kAhead = 100;  // The tick is noted after its record was handed over.
    const std::int64_t latest = number;
    if (message.run != address.run || message.seen > latest + kAhead ||
        message.seen < latest - address.age_max) {
      if (refused++ == 0) {
        SayToOperator(
            fmt::format("warning: a request is {}, and was refused; further ones are counted only",
                        message.run != address.run       ? "for another run, such as that of a log"
                        : message.seen > latest + kAhead ? "about a tick that has not been yet"
                                                         : "too old"));
      }
      return true;
    }
    OperatorWish wish;
    wish.id = static_cast<std::uint32_t>(message.id);
    switch (message.command) {
      case command_t::START:
      case command_t::CLEAR_FAULTS:
      case command_t::FINISH:
      case command_t::STOP:
      case command_t::DISARM:
        break;
      case command_t::BRANCH:
        // An unknown name becomes number -1, which the executor refuses for all to see.
        wish.branch = static_cast<std::int8_t>(graph.FindBranch(message.branch));
        break;
      default:
        return false;  // There is none to arm or to move.
    }
    wish.request = static_cast<OperatorRequest>(message.command);
    mailbox.Put(wish);
    return true;
  }

  lcm::LCM lcm;
  OperatorMailbox& mailbox;
  SequenceGraph<float> graph;
  CommandAddress address;
  std::atomic<std::int64_t> number{0};
  std::atomic<std::int64_t> refused{0};
  std::atomic<std::int64_t> unreadable{0};
  std::atomic<bool> stop{false};
  std::thread thread;
};

LcmCommands::LcmCommands(const std::string& url, OperatorMailbox& mailbox,
                         const SequenceGraph<float>& graph, const CommandAddress& address)
    : implementation_(std::make_unique<Implementation>(url, mailbox, graph, address)) {}

LcmCommands::~LcmCommands() {
  implementation_->stop = true;
  implementation_->thread.join();
}

std::int64_t LcmCommands::unreadable() const { return implementation_->unreadable; }
std::int64_t LcmCommands::refused() const { return implementation_->refused; }
void LcmCommands::NoteTick(std::int64_t number) noexcept { implementation_->number = number; }

}  // namespace tumbler

#include "runtime/record/lcm_commands.h"

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <limits>
#include <thread>
#include <utility>

#include <lcm/lcm-cpp.hpp>

#include "runtime/record/channels.h"
#include "runtime/record/lcm_link.h"

namespace tumbler {

static_assert(command_t::START == static_cast<int>(OperatorRequest::kStart));
static_assert(command_t::BRANCH == static_cast<int>(OperatorRequest::kBranch));
static_assert(command_t::CLEAR_FAULTS == static_cast<int>(OperatorRequest::kClearFaults));
static_assert(command_t::FINISH == static_cast<int>(OperatorRequest::kFinish));
static_assert(command_t::STOP == static_cast<int>(OperatorRequest::kStop));
static_assert(command_t::DISARM == static_cast<int>(OperatorRequest::kDisarm));

bool ReadCommand(std::span<const std::uint8_t> bytes, command_t& message) {
  // Fingerprint, id, run, seen, command, signature and the length of the text, which counts its
  // closing zero.
  constexpr std::size_t kLengthAt = 8 + 8 + 8 + 8 + 1 + sizeof(command_t::mac);
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

namespace {

/// The tick is noted after its record was handed over.
constexpr std::int64_t kAhead = 100;

/// The numbers of the requests that could still be sent again by somebody who has recorded them:
/// those whose state is not too old yet.
class TakenRequests {
 public:
  explicit TakenRequests(std::int64_t age_max) : age_max_(age_max) {}

  /// Whether there is no room for one more. Those that are too old are forgotten.
  [[nodiscard]] bool full(std::int64_t latest) {
    while (!taken_.empty() && latest > taken_.front().until) taken_.pop_front();
    return taken_.size() == kMost;
  }
  /// Takes the number of a request that is not too old. @returns false when it was taken before.
  [[nodiscard]] bool Take(std::int64_t id, std::int64_t latest) {
    for (const Taken& taken : taken_) {
      if (taken.id == id) return false;
    }
    taken_.push_back({id, latest + kAhead + age_max_});
    return true;
  }

 private:
  static constexpr std::size_t kMost = 256;  // No operator asks for so much in two seconds.
  struct Taken {
    std::int64_t id = 0;
    std::int64_t until = 0;  // the last tick in which its state is young enough
  };

  std::int64_t age_max_;
  std::deque<Taken> taken_;
};

}  // namespace

struct LcmCommands::Implementation {
  Implementation(const std::string& url, OperatorMailbox& mailbox_in,
                 const SequenceGraph<float>& graph_in, const CommandAddress& address_in,
                 std::function<void(const std::string&)> say_in)
      : lcm(url),
        mailbox(mailbox_in),
        graph(graph_in),
        address(address_in),
        say(std::move(say_in)),
        taken(address_in.age_max) {
    RequireListening(lcm, url);
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
    if (message.command < command_t::START || message.command > command_t::DISARM)
      return false;  // There is none to arm or to move.
    OperatorWish wish;
    wish.id = static_cast<std::uint32_t>(message.id);
    wish.request = static_cast<OperatorRequest>(message.command);
    if (const char* const why = Objection(message, wish.request)) {
      if (refused++ == 0 && say) {
        say(fmt::format("warning: a request {}, and was refused; further ones are counted only",
                        why));
      }
      return true;
    }
    // Whoever has not seen the answer yet sends the same again, and so may who has recorded it.
    if (!IsTowardsRest(wish.request) && !taken.Take(message.id, number)) return true;
    // An unknown name becomes number -1, which the executor refuses for all to see.
    if (message.command == command_t::BRANCH)
      wish.branch = static_cast<std::int8_t>(graph.FindBranch(message.branch));
    mailbox.Put(wish);
    return true;
  }

  /// Why a request is not obeyed; null: it is.
  const char* Objection(const command_t& message, OperatorRequest request) {
    if (message.run != address.run) return "is for another run, such as that of a log";
    if (IsTowardsRest(request)) return nullptr;
    const std::int64_t latest = number;
    if (message.seen > latest + kAhead) return "is about a tick that has not been yet";
    if (message.seen < latest - address.age_max) return "is too old";
    if (address.key && !address.key->Signed(message)) return "is not signed with the key";
    return taken.full(latest) ? "comes after too many others" : nullptr;
  }

  lcm::LCM lcm;
  OperatorMailbox& mailbox;
  SequenceGraph<float> graph;
  CommandAddress address;
  std::function<void(const std::string&)> say;
  TakenRequests taken;  // Only the thread uses it.
  std::atomic<std::int64_t> number{0};
  std::atomic<std::int64_t> refused{0};
  std::atomic<std::int64_t> unreadable{0};
  std::atomic<bool> stop{false};
  std::thread thread;
};

LcmCommands::LcmCommands(const std::string& url, OperatorMailbox& mailbox,
                         const SequenceGraph<float>& graph, const CommandAddress& address,
                         std::function<void(const std::string&)> say)
    : implementation_(
          std::make_unique<Implementation>(url, mailbox, graph, address, std::move(say))) {}

LcmCommands::~LcmCommands() {
  implementation_->stop = true;
  implementation_->thread.join();
}

std::int64_t LcmCommands::unreadable() const { return implementation_->unreadable; }
std::int64_t LcmCommands::refused() const { return implementation_->refused; }
void LcmCommands::NoteTick(std::int64_t number) noexcept { implementation_->number = number; }

}  // namespace tumbler

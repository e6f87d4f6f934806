#include "runtime/telemetry/lcm_commands.h"

#include <fmt/format.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include <lcm/lcm-cpp.hpp>
#include <tumbler/command_t.hpp>

#include "runtime/telemetry/channels.h"

namespace tumbler {

static_assert(command_t::START == static_cast<int>(OperatorRequest::kStart));
static_assert(command_t::BRANCH == static_cast<int>(OperatorRequest::kBranch));
static_assert(command_t::CLEAR_FAULTS == static_cast<int>(OperatorRequest::kClearFaults));
static_assert(command_t::FINISH == static_cast<int>(OperatorRequest::kFinish));
static_assert(command_t::STOP == static_cast<int>(OperatorRequest::kStop));
static_assert(command_t::DISARM == static_cast<int>(OperatorRequest::kDisarm));

struct LcmCommands::Implementation {
  Implementation(const std::string& url, OperatorMailbox& mailbox_in,
                 const SequenceGraph<float>& graph_in)
      : lcm(url), mailbox(mailbox_in), graph(graph_in) {
    if (!lcm.good()) throw std::runtime_error(fmt::format("{}: LCM cannot use this URL", url));
    // UndefinedBehaviorSanitizer objects to the overload for member functions.
    lcm.subscribeFunction(kCommandChannel, &Implementation::Handle, this);
    thread = std::thread([this] {
      constexpr int kPatience_ms = 100;  // the longest that the destructor has to wait
      while (!stop && lcm.handleTimeout(kPatience_ms) >= 0) {
      }
    });
  }

  static void Handle(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/,
                     const command_t* message, Implementation* self) {
    OperatorWish wish;
    wish.id = static_cast<std::uint32_t>(message->id);
    switch (message->command) {
      case command_t::START:
      case command_t::CLEAR_FAULTS:
      case command_t::FINISH:
      case command_t::STOP:
      case command_t::DISARM:
        break;
      case command_t::BRANCH:
        // An unknown name becomes number -1, which the executor refuses for all to see.
        wish.branch = static_cast<std::int8_t>(self->graph.FindBranch(message->branch));
        break;
      default:
        return;  // Other commands are ignored. There is none to arm or to move.
    }
    wish.request = static_cast<OperatorRequest>(message->command);
    self->mailbox.Put(wish);
  }

  lcm::LCM lcm;
  OperatorMailbox& mailbox;
  SequenceGraph<float> graph;
  std::atomic<bool> stop{false};
  std::thread thread;
};

LcmCommands::LcmCommands(const std::string& url, OperatorMailbox& mailbox,
                         const SequenceGraph<float>& graph)
    : implementation_(std::make_unique<Implementation>(url, mailbox, graph)) {}

LcmCommands::~LcmCommands() {
  implementation_->stop = true;
  implementation_->thread.join();
}

}  // namespace tumbler

#include "tests/flights/flight_wire.h"

#include <cmath>
#include <numbers>
#include <variant>

#include "tests/support/joint_judge.h"

namespace tumbler::testing {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

double Width(const DriveRange& range) { return Wide(range.max) - Wide(range.min); }
double OfCode(unsigned code, const DriveRange& range, double steps) {
  return Wide(range.min) + code * Width(range) / steps;
}

bool IsZero(const WireOrder& order, const WireGrid& grid) {
  return order.kp_nm_per_rad == 0 && order.kd_nm_s_per_rad == 0 &&
         std::abs(order.torque_nm) <= grid.torque_nm;
}

}  // namespace

WireReader::WireReader(const DriveConfig& config) : config_(config), map_(JointOf(config)) {
  const double gear = Wide(map_.gear_ratio);
  WireGrid shaft;
  const auto of_ranges = [&shaft](const ImpedanceRanges& ranges, int fewer) {
    shaft = {Width(ranges.position_rad) / (65536 - fewer),
             Width(ranges.velocity_rad_s) / (4096 - fewer),
             Width(ranges.torque_nm) / (4096 - fewer), Width(ranges.kp_nm_per_rad) / (4096 - fewer),
             Width(ranges.kd_nm_s_per_rad) / (4096 - fewer)};
  };
  if (const auto* mit = std::get_if<MitConfig>(&config)) {
    carries_gains_ = true;
    of_ranges(mit->command, 1);
  } else if (const auto* ak = std::get_if<AkV3Config>(&config)) {
    carries_gains_ = true;
    of_ranges(ak->range, 0);
  } else if (const auto* node = std::get_if<Cia402Config>(&config)) {
    shaft = {kTurn / Wide(node->position_units_per_turn),
             kTurn / Wide(node->velocity_units_per_turn_s), 0.001 * Wide(node->rated_torque_nm)};
  } else {
    shaft = {0, 0.001 * kTurn, 0.001};
  }
  grid_ = {shaft.position_rad / gear, shaft.velocity_rad_s / gear, shaft.torque_nm * gear,
           shaft.kp_nm_per_rad * gear * gear, shaft.kd_nm_s_per_rad * gear * gear};
}

void WireReader::ToJoint(WireOrder& order) const {
  const double direction = Wide(map_.direction), gear = Wide(map_.gear_ratio);
  order.position_rad = direction * order.position_rad / gear + Wide(map_.zero_offset_rad);
  order.velocity_rad_s = direction * order.velocity_rad_s / gear;
  order.torque_nm = direction * order.torque_nm * gear;
  order.kp_nm_per_rad *= gear * gear;
  order.kd_nm_s_per_rad *= gear * gear;
}

void WireReader::ReadMit(const MitConfig& mit, const CanFrame& frame, WireOrder& order) const {
  if (frame.id != mit.command_id || frame.extended || frame.size != 8) return;
  bool ones = true;
  for (std::size_t k = 0; k < 7; ++k) ones = ones && frame.data[k] == 0xff;
  const unsigned last = frame.data[7];
  const bool damiao = mit.dialect == MitDialect::kDamiao;
  if (ones && (last == 0xfd || (damiao && last == 0xfb))) {
    order.kind = WireOrder::Kind::kOff;
  } else if (ones && last == 0xfc) {
    order.kind = WireOrder::Kind::kPrepare;
  } else if (ones && last == 0xfe) {
    order.kind = WireOrder::Kind::kForbidden;
  } else {
    const auto d = [&frame](std::size_t k) { return unsigned{frame.data[k]}; };
    const ImpedanceRanges& ranges = mit.command;
    order.position_rad = OfCode(d(0) << 8 | d(1), ranges.position_rad, 65535);
    order.velocity_rad_s = OfCode(d(2) << 4 | d(3) >> 4, ranges.velocity_rad_s, 4095);
    order.kp_nm_per_rad = OfCode((d(3) & 0xf) << 8 | d(4), ranges.kp_nm_per_rad, 4095);
    order.kd_nm_s_per_rad = OfCode(d(5) << 4 | d(6) >> 4, ranges.kd_nm_s_per_rad, 4095);
    order.torque_nm = OfCode((d(6) & 0xf) << 8 | d(7), ranges.torque_nm, 4095);
    ToJoint(order);
    order.kind = IsZero(order, grid_) ? WireOrder::Kind::kPrepare : WireOrder::Kind::kSetpoint;
  }
}

void WireReader::ReadAkV3(const AkV3Config& ak, const CanFrame& frame, WireOrder& order) const {
  if (!frame.extended || (frame.id & 0xff) != ak.node_id) return;
  if (frame.id >> 8 != 8 || frame.size != 8) {
    order.kind = WireOrder::Kind::kForbidden;
    return;
  }
  const auto d = [&frame](std::size_t k) { return unsigned{frame.data[k]}; };
  const ImpedanceRanges& ranges = ak.range;
  order.kp_nm_per_rad = OfCode(d(0) << 4 | d(1) >> 4, ranges.kp_nm_per_rad, 4096);
  order.kd_nm_s_per_rad = OfCode((d(1) & 0xf) << 8 | d(2), ranges.kd_nm_s_per_rad, 4096);
  order.position_rad = OfCode(d(3) << 8 | d(4), ranges.position_rad, 65536);
  order.velocity_rad_s = OfCode(d(5) << 4 | d(6) >> 4, ranges.velocity_rad_s, 4096);
  order.torque_nm = OfCode((d(6) & 0xf) << 8 | d(7), ranges.torque_nm, 4096);
  ToJoint(order);
  order.kind = IsZero(order, grid_) ? WireOrder::Kind::kOff : WireOrder::Kind::kSetpoint;
}

void WireReader::ReadCanSimple(const CanSimpleConfig& can, const CanFrame& frame,
                               WireOrder& order) {
  if (frame.extended || frame.id >> 5 != can.node_id) return;
  switch (frame.id & 0x1f) {
    case 0x07: {
      const std::uint32_t state = UnsignedField(frame, 0, 4);
      on_ = state == 8;
      if (state == 1) {
        order.kind = WireOrder::Kind::kOff;
      } else {
        order.kind = state == 8 ? WireOrder::Kind::kPrepare : WireOrder::Kind::kForbidden;
      }
      return;
    }
    case 0x18:
      order.kind = on_ ? WireOrder::Kind::kForbidden : WireOrder::Kind::kOff;
      return;
    case 0x0b:
      if (order.kind == WireOrder::Kind::kNothing) order.kind = WireOrder::Kind::kPrepare;
      return;
    case 0x0c:
      order.position_rad = FloatField(frame, 0) * kTurn;
      order.velocity_rad_s = SignedField(frame, 4, 2) * 0.001 * kTurn;
      order.torque_nm = SignedField(frame, 6, 2) * 0.001;
      ToJoint(order);
      order.kind = on_ ? WireOrder::Kind::kSetpoint : WireOrder::Kind::kPrepare;
      return;
    case 0x0d:
      order.velocity_rad_s = FloatField(frame, 0) * kTurn;
      order.torque_nm = FloatField(frame, 4);
      ToJoint(order);
      order.kind = WireOrder::Kind::kBrake;
      return;
    default:
      order.kind = WireOrder::Kind::kForbidden;
  }
}

void WireReader::ReadCia402(const Cia402Config& node, const CanFrame& frame,
                            WireOrder& order) const {
  if (frame.extended) return;
  const bool nmt = frame.id == 0 && frame.data[1] == node.node_id;
  const std::uint32_t function = frame.id & ~0x7fU;
  if (!nmt && (frame.id & 0x7f) != node.node_id) return;
  if (nmt || function == 0x600) {
    order.kind = WireOrder::Kind::kOff;
  } else if (function == 0x200) {
    const std::uint32_t word = UnsignedField(frame, 0, 2);
    order.position_rad = SignedField(frame, 2, 4) * kTurn / Wide(node.position_units_per_turn);
    ToJoint(order);
    order.has_feed_forward = node.feed_forward;
    switch (word) {
      case 0x0f:
        order.kind = WireOrder::Kind::kSetpoint;
        break;
      case 0x02:
        order.kind = WireOrder::Kind::kBrake;
        break;
      case 0x06:
      case 0x07:
        order.kind = WireOrder::Kind::kPrepare;
        break;
      case 0x00:
      case 0x80:
        order.kind = WireOrder::Kind::kOff;
        break;
      default:
        order.kind = WireOrder::Kind::kForbidden;
    }
  } else if (function == 0x300) {
    const double direction = Wide(map_.direction), gear = Wide(map_.gear_ratio);
    order.velocity_rad_s =
        direction * SignedField(frame, 0, 4) * kTurn / Wide(node.velocity_units_per_turn_s) / gear;
    order.torque_nm =
        direction * gear * SignedField(frame, 4, 2) * 0.001 * Wide(node.rated_torque_nm);
  } else {
    order.kind = WireOrder::Kind::kForbidden;
  }
}

WireOrder WireReader::Read(std::span<const CanFrame> frames) {
  WireOrder order;
  for (const CanFrame& frame : frames) {
    if (const auto* mit = std::get_if<MitConfig>(&config_)) {
      ReadMit(*mit, frame, order);
    } else if (const auto* ak = std::get_if<AkV3Config>(&config_)) {
      ReadAkV3(*ak, frame, order);
    } else if (const auto* can = std::get_if<CanSimpleConfig>(&config_)) {
      ReadCanSimple(*can, frame, order);
    } else {
      ReadCia402(std::get<Cia402Config>(config_), frame, order);
    }
  }
  return order;
}

bool WireReader::IsPosition(const CanFrame& frame) const {
  if (const auto* mit = std::get_if<MitConfig>(&config_)) {
    const unsigned mask = mit->dialect == MitDialect::kDamiao ? 0xfU : 0xffU;
    return frame.id == mit->reply_id && !frame.extended && frame.size >= 6 &&
           ((frame.data[0] ^ mit->command_id) & mask) == 0;
  }
  if (const auto* ak = std::get_if<AkV3Config>(&config_))
    return frame.extended && frame.id == (0x2900U | ak->node_id);
  if (frame.extended) return false;
  if (const auto* can = std::get_if<CanSimpleConfig>(&config_))
    return frame.id == (std::uint32_t{can->node_id} << 5 | 0x09U);
  return frame.id == 0x180U + std::get<Cia402Config>(config_).node_id;
}

}  // namespace tumbler::testing

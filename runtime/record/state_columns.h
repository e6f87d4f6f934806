#pragma once

#include <string_view>

#include <tumbler/state_t.hpp>

#include "runtime/executor/faults.h"
#include "runtime/executor/joint_fields.h"
#include "runtime/executor/tick.h"
#include "runtime/executor/tick_fields.h"

namespace tumbler {

/// Calls `visit(name, value)` for the columns of a tick, in a table of ticks, that come before
/// those of its joints. A value is what TickFieldRow says of `Shown`.
template <typename Visit>
void ForEachTickColumn(const state_t& state, Visit&& visit) {
  ForEachRowBy<kTickFields, &TickField::column_place>([&]<typename Row>(const Row& row) {
    if constexpr (Row::kShown) {
      if (row.field.column_place < kBehindJoints) visit(row.field.column, row.shown(state));
    }
  });
}

/// Calls `visit(field, in_message)` for the columns of each joint. Planned, limited, encoded and
/// measured values come first, and those that are not in a record last. A column's name is the
/// joint's, `_` and `field.column`.
template <typename Visit>
void ForEachJointColumn(const Visit& visit) {
  for (const bool of_part : {true, false}) {
    ForEachJointField([&](const JointField& field, auto /*in_record*/, auto in_message) {
      if ((std::string_view(field.name).find('.') != std::string_view::npos) == of_part) {
        visit(field, in_message);
      }
    });
  }
  ForEachDerivedJointField([&](const JointField& field, auto /*of_tick*/, auto in_message) {
    visit(field, in_message);
  });
}

/// The columns that come after those of the joints, as ForEachTickColumn.
template <typename Visit>
void ForEachSensorColumn(const state_t& state, Visit&& visit) {
  ForEachRowBy<kTickFields, &TickField::column_place>([&]<typename Row>(const Row& row) {
    if constexpr (Row::kShown) {
      if (row.field.column_place >= kBehindJoints) visit(row.field.column, row.shown(state));
    }
  });
}

}  // namespace tumbler

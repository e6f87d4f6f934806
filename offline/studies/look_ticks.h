#pragma once

#include <cstddef>
#include <vector>

#include "common/files/sequence_toml.h"
#include "offline/studies/trial.h"

namespace tumbler {

/// The ticks of a script in which the judges look at robots that are played in lanes: every so many
/// ticks, and in each tick in which they judge something: where what the executor does changes, and
/// where a target of a motion's purpose falls due, or the pitch 2 s after a motion; and in all of
/// the kRestWatched_s before a speed is judged. So what a motion is for is judged of what the
/// twin's judges see. A robot's rest, its departure and overlaps are those of the ticks that are
/// looked at.
/// @returns  the ticks in order, from the first on; behind them the number of ticks.
/// @param every  at least 1.
[[nodiscard]] std::vector<std::size_t> LookTicks(const Script& script, const SequenceFile& file,
                                                 std::size_t every);

}  // namespace tumbler

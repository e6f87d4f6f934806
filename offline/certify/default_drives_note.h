#pragma once

#include <string>

#include "offline/problem/problem.h"

namespace tumbler {

/// Everything that a task asks for and the drives of a simulation without a drives file
/// (kDefaultDrives) do not carry, as a text with what to do about it; empty where they carry it
/// all. What plays the motion refuses it then, so that it is worth knowing before the search.
std::string BeyondDefaultDrives(const Problem& problem);

}  // namespace tumbler

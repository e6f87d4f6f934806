#pragma once

#include <string>

#include "offline/studies/study.h"

namespace tumbler {

/// A page about a study, complete in itself and without scripts: the share with its interval, where
/// robots came to grief, what they have in common, and the map over the two most telling
/// quantities, with every robot in it.
std::string RobustnessPage(const RobustnessResult& result);

}  // namespace tumbler

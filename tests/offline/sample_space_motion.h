#pragma once

#include "offline/pages/space_page.h"

namespace tumbler {

/// A robot of four legs that trots around a bend on level ground, hops at the end, and stands,
/// made from formulas: 13 bodies, 2 s of motion and 0.3 s of settling, 60 frames a second. Feet in
/// stance do not slip. Forces and torques are made up. A step and a post stand beside its way.
SpaceMotionPage SampleSpaceMotion();

}  // namespace tumbler

#pragma once

#include <vector>

namespace tumbler {

/// Free control points of leg 1, then of leg 2, of a roll that was found for the shipped task when
/// nothing kept the robot's own shapes apart: from 0.546 to 0.816 s its feet are inside each other,
/// by up to 19.3 mm.
inline std::vector<double> CrossingRoll() {
  return {2.516959776258922,   2.890892052581651,   2.2502447925072464,  1.8993161620912429,
          1.658505650814102,   0.6168646107649305,  -2.0334470617767155, -2.165022883421573,
          -2.5382101788576796, -0.6714086586299965, -2.4046609760254696, -2.74201000508897};
}

}  // namespace tumbler

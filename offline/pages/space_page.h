#pragma once

#include <string>
#include <utility>
#include <vector>

#include "offline/model/obstacle.h"
#include "offline/model/pose.h"
#include "offline/model/shape.h"
#include "offline/model/spatial.h"

namespace tumbler {

/// A body of the robot. The first of them is the root, which the page's camera follows.
struct SpaceBody {
  std::string name;
  std::vector<Shape<Spatial>> shapes;  ///< In the body's frame. No half-spaces.
  /// From 0 to 7: one of the pages' eight colours, best the same for all bodies of a limb, which
  /// are told apart by their brightness. -1: grey.
  int hue = -1;
};

/// A contact that carries force.
struct SpaceContact {
  SpaceVector point_m;  ///< In the world.
  SpaceVector force_n;  ///< On the robot, in world axes.
};

/// One instant of the motion.
struct SpaceFrame {
  double time_s = 0;
  std::vector<Pose> poses;  ///< Of each body in the world, in the order of `bodies`.
  std::vector<SpaceContact> contacts;
};

/// A curve over time.
struct SpaceSeries {
  std::string name;
  std::vector<double> values;  ///< One a frame; NaN: there was none.
  int hue = -1;                ///< As a body's. -1: that of its place in the plot.
};

struct SpacePlot {
  std::string title;  ///< e.g. `Joint torque`
  std::string unit;   ///< e.g. `N·m`
  std::vector<SpaceSeries> series;
  std::vector<double> limits;  ///< Drawn as dashed lines. May be empty.
};

/// Everything that a page shows of a motion in space. Texts may be any; the page shows them as
/// texts.
struct SpaceMotionPage {
  std::string title;     ///< e.g. `trot`
  std::string subtitle;  ///< e.g. the tool's version and the seed; no date.
  std::vector<SpaceBody> bodies;
  /// At rest in the world: half-spaces, of which the part near the motion is drawn, and solids.
  std::vector<Obstacle<Spatial>> obstacles;
  /// At least two, about 60 a second: the page shows what is between them, too.
  std::vector<SpaceFrame> frames;
  /// When the motion ends [s], on the clock of the frames. What they show after it is settling.
  double motion_s = 0;
  std::vector<SpacePlot> plots;
  /// Names, and values with their units, in the order in which they are shown.
  std::vector<std::pair<std::string, std::string>> facts;
  std::string notes;  ///< Each line is a paragraph.
};

/// A page in one file that needs no network.
///
/// It plays the motion as solids with their shadows on the ground and arrows for the contact forces
/// (z up, parallel projection). The view turns by dragging or with the arrow keys, and comes nearer
/// with the wheel, two fingers, or + and -. Below are poses side by side, which are all that is
/// printed of the robot, or shown without scripts, and the plots. Nothing moves until it is played.
/// The page's address may end in a fragment of these parts, joined by `&`:
///   - `t=0.75`: that time [s], standing still;
///   - `from=side`, `front`, `top` or `corner`, or `from=30,20`: azimuth and elevation [degrees] of
///     the viewer. 0,0 is the side, with x to the right; the azimuth turns towards +x;
///   - `camera=fit`: the whole motion, `camera=follow`: the robot in the middle; by default the one
///     that suits the motion;
///   - `view=robot`: the robot alone, as large as the window; `view=strip`: the poses alone;
///   - `theme=light`, `theme=dark`: by default the one that the browser prefers.
/// @throws std::invalid_argument  naming the field, when a number is not finite, a size or a hue is
/// wrong, or times do not increase.
std::string SpacePage(const SpaceMotionPage& page);

/// The poses of the page side by side as a picture of this width, SVG in a file of its own: eight
/// instants evenly spaced over the motion, each centred on the robot, all from the same corner and
/// of one scale. In two rows where it is narrow.
/// @throws std::invalid_argument  as SpacePage, and when the width is less than 200.
std::string SpaceFilmstrip(const SpaceMotionPage& page, int width_px);

}  // namespace tumbler

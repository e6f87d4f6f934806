#include "offline/pages/space_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <set>
#include <string_view>
#include <utility>

#include "common/core/functions.h"

namespace tumbler {
namespace {

using Vector = SpaceVector;
using Colour = std::array<double, 3>;  // of 255

constexpr Colour kGrey{0x8b, 0x95, 0xa0};
/// Middle tones of the pages' hues, which stand out from light and from dark paper.
constexpr std::array<Colour, 8> kHues{{{0xd9, 0x6a, 0x2b},
                                       {0x3a, 0x82, 0xc9},
                                       {0xb3, 0x96, 0x26},
                                       {0xc2, 0x4f, 0x94},
                                       {0x1f, 0x98, 0xa1},
                                       {0x84, 0x68, 0xd0},
                                       {0x96, 0x66, 0x45},
                                       {0x6a, 0x96, 0x3a}}};
constexpr double kDarker = 0.76;  // every other body of a hue

// The light comes over the viewer's left shoulder. page/space_stage.js has the same.
const Vector kLight = Vector(-0.35, 0.7, 0.62).normalized();
double Brightness(const Vector& normal) {
  return (0.5 + 0.58 * std::max(0.0, normal.dot(kLight))) *
         (0.82 + 0.18 * std::max(0.0, normal.z()));
}

std::string Hex(const Colour& colour, double brightness = 1) {
  std::string text = "#";
  for (const double part : colour)
    text += fmt::format("{:02x}", static_cast<int>(std::clamp(part * brightness, 0.0, 255.0)));
  return text;
}

Colour FromHex(std::string_view text) {
  const auto part = [&](std::size_t i) {
    return static_cast<double>(std::stoi(std::string(text.substr(1 + 2 * i, 2)), nullptr, 16));
  };
  return {part(0), part(1), part(2)};
}

/// A number of pixels, or of other units with more digits, without needless characters.
std::string Short(double value, int digits = 1) {
  std::string text = fmt::format("{:.{}f}", value, digits);
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

/// The corners of the convex hull of points in the plane, in their order around it.
std::vector<std::array<double, 2>> HullOf(std::vector<std::array<double, 2>> points) {
  std::ranges::sort(points);
  if (points.size() < 3) return points;
  const auto left = [](const auto& a, const auto& b, const auto& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 1e-12;
  };
  std::vector<std::array<double, 2>> hull;
  for (int side = 0; side < 2; ++side) {
    const std::size_t from = hull.size();
    for (const auto& point : points) {
      while (hull.size() > from + 1 && !left(hull[hull.size() - 2], hull.back(), point))
        hull.pop_back();
      hull.push_back(point);
    }
    hull.pop_back();
    std::ranges::reverse(points);
  }
  return hull;
}

std::string PathOf(const std::vector<std::array<double, 2>>& points, int digits) {
  std::string path;
  for (const auto& [x, y] : points) {
    path += path.empty() ? 'M' : 'L';
    path += Short(x, digits) + ' ' + Short(y, digits);
  }
  return path + 'z';
}

/// A solid, or a piece of one, as it is drawn.
struct Drawn {
  Vector middle;     // right, up, towards the viewer
  double depth = 0;  // of its surface on average, towards the viewer
  std::string svg;
  /// Of a box: the outer normals of the sides that are seen, and n . r on them.
  std::vector<std::pair<Vector, double>> sides;
  double volume = 0;

  [[nodiscard]] bool IsBehind(const Drawn& other) const {
    return std::ranges::all_of(
        other.sides, [&](const auto& side) { return side.first.dot(middle) < side.second - 1e-9; });
  }
};

/// From back to front. The plane of a side that is seen has what it hides behind it, so a box
/// parts the others into those before and after it.
std::string InOrder(std::vector<Drawn> solids) {
  const auto box = std::ranges::max_element(solids, {}, &Drawn::volume);
  if (box == solids.end()) return "";
  std::string svg;
  if (box->sides.empty()) {
    std::ranges::stable_sort(solids, {}, &Drawn::depth);
    for (const Drawn& solid : solids) svg += solid.svg;
    return svg;
  }
  const Drawn chosen = std::move(*box);
  solids.erase(box);
  const auto front = std::stable_partition(
      solids.begin(), solids.end(), [&](const Drawn& solid) { return solid.IsBehind(chosen); });
  svg = InOrder({std::make_move_iterator(solids.begin()), std::make_move_iterator(front)});
  return svg + chosen.svg +
         InOrder({std::make_move_iterator(front), std::make_move_iterator(solids.end())});
}

class Painter {
 public:
  explicit Painter(const SpaceCamera& camera) : camera_(camera) {}

  /// Into right, up, towards the viewer, from the target.
  [[nodiscard]] Vector See(const Vector& point) const {
    return camera_.view * (point - camera_.target);
  }
  [[nodiscard]] std::array<double, 2> At(const Vector& seen) const {
    return {camera_.px_per_m * seen.x(), -camera_.px_per_m * seen.y()};
  }
  [[nodiscard]] double Px(double length_m) const { return camera_.px_per_m * length_m; }

  void Add(const Shape<Spatial>& shape, const Pose& pose, const std::string& colour,
           std::vector<Drawn>& out) const {
    switch (shape.kind()) {
      case ShapeKind::kHalfSpace:
        return;
      case ShapeKind::kSphere:
        out.push_back(Ball(See(pose * shape.centre), shape.radius_m, colour));
        return;
      case ShapeKind::kCapsule:
        AddCapsule(shape, pose, colour, out);
        return;
      case ShapeKind::kBox:
        out.push_back(Box(shape, pose, colour));
    }
  }

  /// The transform of SVG from s and t of a carpet.
  [[nodiscard]] std::string OnCarpet(const SpaceCarpet& carpet) const {
    const auto s = At(camera_.view * carpet.along_s), t = At(camera_.view * carpet.along_t);
    const auto o = At(See(carpet.origin));
    return fmt::format("transform=\"matrix({} {} {} {} {} {})\"", Short(s[0], 3), Short(s[1], 3),
                       Short(t[0], 3), Short(t[1], 3), Short(o[0], 2), Short(o[1], 2));
  }

  [[nodiscard]] std::string Arrow(const SpaceContact& contact) const {
    const auto from = At(See(contact.point_m));
    const auto to = At(See(contact.point_m + camera_.m_per_n * contact.force_n));
    const double x = to[0] - from[0], y = to[1] - from[1];
    const double length = portable::Length(x, y);
    if (length < 1.5) return "";
    const double head = std::min(6.0, 0.6 * length), c = x / length, s = y / length;
    const auto corner = [&](double side) {
      return Short(to[0] - head * c - side * s) + ' ' + Short(to[1] - head * s + side * c);
    };
    return fmt::format("<path class=\"force\" d=\"M{} {}L{} {}M{}L{} {}L{}\"/>", Short(from[0]),
                       Short(from[1]), Short(to[0]), Short(to[1]), corner(0.4 * head), Short(to[0]),
                       Short(to[1]), corner(-0.4 * head));
  }

 private:
  [[nodiscard]] Drawn Ball(const Vector& centre, double radius_m, const std::string& colour) const {
    const auto at = At(centre);
    Drawn ball;
    ball.middle = centre;
    ball.depth = centre.z() + 2 * radius_m / 3;  // of a half sphere
    ball.svg = fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"url(#ball-{})\"/>",
                           Short(at[0]), Short(at[1]), Short(Px(radius_m)), colour.substr(1));
    return ball;
  }

  void AddCapsule(const Shape<Spatial>& shape, const Pose& pose, const std::string& colour,
                  std::vector<Drawn>& out) const {
    const std::vector<Vector> ends = CoreVertices(shape);
    Vector a = See(pose * ends[0]), b = See(pose * ends[1]);
    // The light is on the side of the rectangle's upper edge.
    if ((b.x() - a.x()) * kLight.y() - (b.y() - a.y()) * kLight.x() < 0) std::swap(a, b);
    const double r = shape.radius_m;
    const int pieces = std::clamp(static_cast<int>((b - a).norm() / (2.5 * r)), 1, 4);
    for (int i = 0; i < pieces; ++i) {
      const Vector from = a + (b - a) * (static_cast<double>(i) / pieces);
      const Vector to = a + (b - a) * (static_cast<double>(i + 1) / pieces);
      const auto p = At(from), q = At(to);
      const double x = q[0] - p[0], y = q[1] - p[1], length = portable::Length(x, y);
      if (length < 0.05) {
        out.push_back(Ball(from.z() > to.z() ? from : to, r, colour));
        continue;
      }
      Drawn piece;
      piece.middle = 0.5 * (from + to);
      piece.depth = piece.middle.z() + 0.785 * r;  // of half a cylinder
      const double radius = Px(r), c = x / length, s = y / length;
      piece.svg = fmt::format(
          "<rect x=\"{0}\" y=\"{0}\" width=\"{1}\" height=\"{2}\" rx=\"{3}\" "
          "transform=\"matrix({4} {5} {6} {4} {7} {8})\" fill=\"url(#tube-{9})\"/>",
          Short(-radius), Short(length + 2 * radius), Short(2 * radius), Short(radius), Short(c, 3),
          Short(s, 3), Short(-s, 3), Short(p[0]), Short(p[1]), colour.substr(1));
      out.push_back(std::move(piece));
    }
  }

  [[nodiscard]] Drawn Box(const Shape<Spatial>& shape, const Pose& pose,
                          const std::string& colour) const {
    Drawn box;
    box.middle = See(pose * shape.centre);
    const SpaceMatrix axes = pose.rotation * shape.rotation.m;
    const Vector& h = shape.half_extents;
    std::array<Vector, 3> sides;
    box.volume = 1;
    for (int i = 0; i < 3; ++i) {
      Vector side = camera_.view * axes.col(i);
      if (side.z() < 0) side = -side;  // the one that is seen
      sides[static_cast<std::size_t>(i)] = side;
      box.volume *= h[i] + shape.radius_m + 1e-9;
    }
    const Colour base = FromHex(colour);
    if (shape.radius_m > 0) {
      std::vector<std::array<double, 2>> corners;
      for (const Vector& corner : CoreVertices(shape)) corners.push_back(At(See(pose * corner)));
      const std::string shade = Hex(base, Brightness(Vector(0.25, -0.25, 0.93)));
      box.svg =
          fmt::format("<path d=\"{}\" fill=\"{}\" stroke=\"{}\" stroke-width=\"{}\"/>",
                      PathOf(HullOf(corners), 1), shade, shade, Short(Px(2 * shape.radius_m)));
    }
    box.depth = box.middle.z();
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector& n = sides[i];
      if (n.z() < 1e-6) continue;
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      const Vector centre = box.middle + n * (h[static_cast<int>(i)] + shape.radius_m);
      const Vector u = sides[j] * h[static_cast<int>(j)], v = sides[k] * h[static_cast<int>(k)];
      box.sides.emplace_back(n, n.dot(centre));
      if (u.norm() == 0 || v.norm() == 0) continue;  // a rounded edge, or a thin plate's
      const std::string shade = Hex(base, Brightness(n));
      box.svg += fmt::format(
          "<path d=\"{}\" fill=\"{}\" stroke=\"{}\" stroke-width=\".4\"/>",
          PathOf({At(centre + u + v), At(centre + u - v), At(centre - u - v), At(centre - u + v)},
                 1),
          shade, shade);
    }
    return box;
  }

  const SpaceCamera& camera_;
};

/// The shadow of a shape as a path in x and y.
std::string ShadowOf(const Shape<Spatial>& shape, const Pose& pose) {
  std::vector<std::array<double, 2>> points;
  for (const Vector& vertex : CoreVertices(shape)) {
    const Vector p = pose * vertex;
    points.push_back({p.x(), p.y()});
  }
  return fmt::format("<path d=\"{}\" stroke-width=\"{}\"/>", PathOf(HullOf(points), 3),
                     Short(2 * shape.radius_m, 4));
}

std::string GridOf(const SpaceCarpet& carpet) {
  std::string path;
  const auto& [s, t] = std::pair(carpet.s, carpet.t);
  const auto lines = [&](const std::array<double, 2>& range) {
    return static_cast<int>(std::lround((range[1] - range[0]) / carpet.step_m));
  };
  for (int i = 0; i <= lines(s); ++i) {
    path += fmt::format("M{} {}V{}", Short(s[0] + i * carpet.step_m, 4), Short(t[0], 4),
                        Short(t[1], 4));
  }
  for (int i = 0; i <= lines(t); ++i) {
    path += fmt::format("M{} {}H{}", Short(s[0], 4), Short(t[0] + i * carpet.step_m, 4),
                        Short(s[1], 4));
  }
  return path;
}

/// What is left of a convex polygon where value(corner), a linear function, is not below zero.
template <class Value>
std::vector<std::array<double, 2>> Cut(const std::vector<std::array<double, 2>>& polygon,
                                       Value value) {
  std::vector<std::array<double, 2>> left;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    const double of_a = value(a), of_b = value(b);
    if (of_a >= 0) left.push_back(a);
    if ((of_a >= 0) == (of_b >= 0)) continue;
    const double share = of_a / (of_a - of_b);
    left.push_back({a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])});
  }
  return left;
}

/// The carpet of a half-space around an extent.
SpaceCarpet CarpetOf(const Shape<Spatial>& half_space, const SpaceExtent& around, double step_m) {
  SpaceCarpet carpet;
  const Vector& n = carpet.normal = half_space.normal;
  const Vector& c = half_space.centre;
  carpet.step_m = step_m;
  carpet.ground = n.z() > 0.3;
  if (carpet.ground) {
    carpet.origin = {0, 0, n.dot(c) / n.z()};
    carpet.along_s = {1, 0, -n.x() / n.z()};
    carpet.along_t = {0, 1, -n.y() / n.z()};
  } else {
    carpet.along_s =
        std::abs(n.z()) < 0.9 ? n.cross(Vector::UnitZ()).normalized() : Vector::UnitX();
    carpet.along_t = carpet.along_s.cross(n);
    carpet.origin = n * n.dot(c);
  }
  carpet.s = carpet.t = {std::numeric_limits<double>::infinity(),
                         -std::numeric_limits<double>::infinity()};
  for (int corner = 0; corner < 8; ++corner) {
    Vector p;
    for (int i = 0; i < 3; ++i) p[i] = (corner >> i & 1) != 0 ? around.high[i] : around.low[i];
    const double s = carpet.ground ? p.x() : carpet.along_s.dot(p - carpet.origin);
    const double t = carpet.ground ? p.y() : carpet.along_t.dot(p - carpet.origin);
    carpet.s = {std::min(carpet.s[0], s), std::max(carpet.s[1], s)};
    carpet.t = {std::min(carpet.t[0], t), std::max(carpet.t[1], t)};
  }
  for (auto* range : {&carpet.s, &carpet.t}) {
    (*range)[0] = step_m * std::floor((*range)[0] / step_m);
    (*range)[1] = step_m * std::ceil((*range)[1] / step_m);
  }
  carpet.outline = {{carpet.s[0], carpet.t[0]},
                    {carpet.s[1], carpet.t[0]},
                    {carpet.s[1], carpet.t[1]},
                    {carpet.s[0], carpet.t[1]}};
  return carpet;
}

}  // namespace

SpaceView SpaceView::From(double azimuth_rad, double elevation_rad) {
  const auto [sa, ca] = portable::SinCos(azimuth_rad);
  const auto [se, ce] = portable::SinCos(elevation_rad);
  return {{ca, sa, 0}, {-se * sa, se * ca, ce}, {ce * sa, -ce * ca, se}};
}

SpaceExtent SpaceExtent::None() {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  return {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
}

void SpaceExtent::Add(const SpaceVector& point) {
  for (int i = 0; i < 3; ++i) {
    low[i] = std::min(low[i], point[i]);
    high[i] = std::max(high[i], point[i]);
  }
}

SpaceExtent ExtentOf(const SpaceMotionPage& page, const SpaceFrame& frame) {
  SpaceExtent extent = SpaceExtent::None();
  for (std::size_t b = 0; b < page.bodies.size(); ++b) {
    extent.Add(frame.poses[b].translation);
    for (const Shape<Spatial>& shape : page.bodies[b].shapes) {
      const Vector around(shape.radius_m, shape.radius_m, shape.radius_m);
      for (const Vector& vertex : CoreVertices(shape)) {
        extent.Add(frame.poses[b] * vertex + around);
        extent.Add(frame.poses[b] * vertex - around);
      }
    }
  }
  return extent;
}

double NiceBelow(double value) {
  if (!(value > 1e-6)) return 1e-6;
  double power = 1;
  while (power > value) power /= 10;
  while (10 * power <= value) power *= 10;
  return value >= 5 * power ? 5 * power : value >= 2 * power ? 2 * power : power;
}

std::vector<SpaceCarpet> CarpetsOf(const SpaceMotionPage& page, const SpaceExtent& around,
                                   double step_m) {
  std::vector<SpaceCarpet> carpets;
  for (const Obstacle<Spatial>& obstacle : page.obstacles) {
    if (!obstacle.shape.half_space) continue;
    SpaceCarpet carpet = CarpetOf(obstacle.shape, around, step_m);
    for (const Obstacle<Spatial>& other : page.obstacles) {
      if (!other.shape.half_space || &other == &obstacle) continue;
      carpet.outline = Cut(carpet.outline, [&](const std::array<double, 2>& at) {
        const Vector p = carpet.origin + at[0] * carpet.along_s + at[1] * carpet.along_t;
        return other.shape.normal.dot(p - other.shape.centre) + 1e-9;
      });
    }
    if (carpet.outline.size() > 2) carpets.push_back(std::move(carpet));
  }
  return carpets;
}

std::vector<std::string> BodyColours(const SpaceMotionPage& page) {
  std::vector<std::string> colours;
  std::array<int, 9> count{};
  for (const SpaceBody& body : page.bodies) {
    const std::size_t hue = body.hue < 0 ? kHues.size() : static_cast<std::size_t>(body.hue);
    const Colour& colour = hue == kHues.size() ? kGrey : kHues.at(hue);
    const int before = count.at(hue)++;
    colours.push_back(Hex(colour, before % 2 == 0 ? 1 : kDarker));
  }
  return colours;
}

std::string PaintFrame(const SpaceMotionPage& page, const SpaceFrame& frame,
                       const std::vector<SpaceCarpet>& carpets, const SpaceCamera& camera) {
  const Painter painter(camera);
  const std::vector<std::string> colours = BodyColours(page);
  std::string shadows;
  std::vector<Drawn> solids;
  const auto add = [&](const Shape<Spatial>& shape, const Pose& pose, const std::string& colour) {
    if (shape.half_space) return;
    shadows += ShadowOf(shape, pose);
    painter.Add(shape, pose, colour, solids);
  };
  for (const Obstacle<Spatial>& obstacle : page.obstacles) add(obstacle.shape, {}, kObstacleColour);
  for (std::size_t b = 0; b < page.bodies.size(); ++b) {
    for (const Shape<Spatial>& shape : page.bodies[b].shapes)
      add(shape, frame.poses[b], colours[b]);
  }
  std::string svg;
  for (std::size_t k = 0; k < carpets.size(); ++k) {
    const SpaceCarpet& carpet = carpets[k];
    const std::string outline = PathOf(carpet.outline, 4);
    const std::string cut = fmt::format("cut-{:.0f}-{}", 1e3 * frame.time_s, k);
    svg += fmt::format(
        "<clipPath id=\"{0}\"><path d=\"{1}\"/></clipPath><g {2} clip-path=\"url(#{0})\">", cut,
        outline, painter.OnCarpet(carpet));
    if (carpet.normal.dot(camera.view.toward) > 0) {
      svg += "<path class=\"carpet\" d=\"" + outline + "\"/>";
      if (carpet.ground) svg += "<g class=\"shadow\">" + shadows + "</g>";
    }
    svg += fmt::format("<path class=\"grid\" d=\"{}\"/></g>\n", GridOf(carpet));
  }
  svg += "<g class=\"solids\" stroke-linejoin=\"round\">" + InOrder(std::move(solids)) + "</g>\n";
  if (camera.m_per_n > 0) {
    for (const SpaceContact& contact : frame.contacts) svg += painter.Arrow(contact);
  }
  return svg;
}

std::string SolidGradients(const SpaceMotionPage& page) {
  const std::vector<std::string> of_bodies = BodyColours(page);
  std::set<std::string> colours(of_bodies.begin(), of_bodies.end());
  colours.insert(kObstacleColour);
  std::string svg;
  for (const std::string& colour : colours) {
    const Colour base = FromHex(colour);
    const auto stop = [&](double at, double brightness) {
      return fmt::format("<stop offset=\"{}\" stop-color=\"{}\"/>", Short(at, 2),
                         Hex(base, brightness));
    };
    svg += fmt::format("<radialGradient id=\"ball-{}\" fx=\".32\" fy=\".2\">", colour.substr(1)) +
           stop(0, 1.04) + stop(0.5, 0.87) + stop(1, 0.46) + "</radialGradient>";
    svg += fmt::format("<linearGradient id=\"tube-{}\" x2=\"0\" y2=\"1\">", colour.substr(1));
    for (const double at : {0.0, 0.15, 0.35, 0.65, 0.9, 1.0}) {
      const double up = 1 - 2 * at;
      svg += stop(at, Brightness(Vector(0, up, std::sqrt(1 - up * up))));
    }
    svg += "</linearGradient>\n";
  }
  return svg;
}

}  // namespace tumbler

#include "offline/pages/space_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <sstream>

#include "common/files/json.h"
#include "common/files/markup.h"
#include "offline/pages/page_file.h"
#include "offline/pages/report_checks.h"
#include "offline/pages/report_page.h"
#include "offline/pages/space_picture.h"

namespace tumbler {
namespace {

using Vector = SpaceVector;

constexpr std::size_t kPoses = 8;
/// The corner from which poses are shown, and from which the page looks first [degrees].
constexpr double kAzimuth_deg = 30, kElevation_deg = 18;
constexpr int kNarrow_px = 640;  // two rows below it

void CheckVector(const Vector& vector, const std::string& field) {
  for (int i = 0; i < 3; ++i) CheckFinite(vector[i], fmt::format("{}[{}]", field, i));
}

void CheckHue(int hue, const std::string& field) {
  if (hue < -1 || hue > 7) RefuseField(field, fmt::format("is {}, must be from -1 to 7", hue));
}

void CheckShape(const Shape<Spatial>& shape, const std::string& field) {
  CheckVector(shape.centre, field + ".centre");
  CheckVector(shape.half_extents, field + ".half_extents");
  CheckVector(shape.normal, field + ".normal");
  CheckFinite(shape.radius_m, field + ".radius_m");
}

void CheckFrame(const SpaceMotionPage& page, std::size_t index) {
  const SpaceFrame& frame = page.frames[index];
  const std::string name = fmt::format("frames[{}]", index);
  CheckFinite(frame.time_s, name + ".time_s");
  if (index > 0 && frame.time_s <= page.frames[index - 1].time_s) {
    RefuseField(name + ".time_s", fmt::format("is {}, must be later than the {} before it",
                                              frame.time_s, page.frames[index - 1].time_s));
  }
  CheckSize(frame.poses.size(), page.bodies.size(), name + ".poses", "body");
  for (std::size_t b = 0; b < frame.poses.size(); ++b) {
    const std::string pose = fmt::format("{}.poses[{}]", name, b);
    CheckVector(frame.poses[b].translation, pose + ".translation");
    for (int i = 0; i < 3; ++i) CheckVector(frame.poses[b].rotation.col(i), pose + ".rotation");
  }
  for (std::size_t k = 0; k < frame.contacts.size(); ++k) {
    CheckVector(frame.contacts[k].point_m, fmt::format("{}.contacts[{}].point_m", name, k));
    CheckVector(frame.contacts[k].force_n, fmt::format("{}.contacts[{}].force_n", name, k));
  }
}

void Check(const SpaceMotionPage& page) {
  CheckFinite(page.motion_s, "motion_s");
  if (page.bodies.empty()) RefuseField("bodies", "is empty, must have the root at least");
  for (std::size_t b = 0; b < page.bodies.size(); ++b) {
    const std::string name = fmt::format("bodies[{}]", b);
    CheckHue(page.bodies[b].hue, name + ".hue");
    for (std::size_t k = 0; k < page.bodies[b].shapes.size(); ++k) {
      const Shape<Spatial>& shape = page.bodies[b].shapes[k];
      CheckShape(shape, fmt::format("{}.shapes[{}]", name, k));
      if (shape.half_space) RefuseField(fmt::format("{}.shapes[{}]", name, k), "is a half-space");
    }
  }
  for (std::size_t k = 0; k < page.obstacles.size(); ++k)
    CheckShape(page.obstacles[k].shape, fmt::format("obstacles[{}].shape", k));
  if (page.frames.size() < 2) {
    RefuseField("frames", fmt::format("has {} entries, must have at least 2", page.frames.size()));
  }
  for (std::size_t i = 0; i < page.frames.size(); ++i) CheckFrame(page, i);
  for (std::size_t k = 0; k < page.plots.size(); ++k) {
    const std::string name = fmt::format("plots[{}]", k);
    for (std::size_t s = 0; s < page.plots[k].series.size(); ++s) {
      const SpaceSeries& series = page.plots[k].series[s];
      const std::string one = fmt::format("{}.series[{}]", name, s);
      CheckHue(series.hue, one + ".hue");
      CheckSize(series.values.size(), page.frames.size(), one + ".values", "frame");
      for (std::size_t i = 0; i < series.values.size(); ++i) {
        if (std::isinf(series.values[i]))
          RefuseField(fmt::format("{}.values[{}]", one, i), "is infinite");
      }
    }
    for (std::size_t i = 0; i < page.plots[k].limits.size(); ++i)
      CheckFinite(page.plots[k].limits[i], fmt::format("{}.limits[{}]", name, i));
  }
}

/// The quaternion x, y, z, w of a rotation; its largest part is above zero.
std::array<double, 4> QuaternionOf(const SpaceMatrix& R) {
  // 4 times the square of each part [x, y, z, w].
  const double trace = R.trace();
  const std::array<double, 4> squares = {1 + 2 * R(0, 0) - trace, 1 + 2 * R(1, 1) - trace,
                                         1 + 2 * R(2, 2) - trace, 1 + trace};
  const auto largest =
      static_cast<std::size_t>(std::ranges::max_element(squares) - squares.begin());
  const double root = std::sqrt(squares.at(largest)), k = 0.5 / root;
  std::array<double, 4> q{};
  if (largest == 3) {
    q = {k * (R(2, 1) - R(1, 2)), k * (R(0, 2) - R(2, 0)), k * (R(1, 0) - R(0, 1)), 0.5 * root};
    return q;
  }
  const int i = static_cast<int>(largest), j = (i + 1) % 3, l = (i + 2) % 3;
  q.at(largest) = 0.5 * root;
  q.at(static_cast<std::size_t>(j)) = k * (R(j, i) + R(i, j));
  q.at(static_cast<std::size_t>(l)) = k * (R(l, i) + R(i, l));
  q[3] = k * (R(l, j) - R(j, l));
  return q;
}

/// What the page does not need to the last bit takes fewer characters.
double Rounded(double value) { return std::round(value * 1e5) / 1e5; }
std::int64_t Whole(double value, double unit) { return std::llround(value / unit); }

Json VectorToJson(const Vector& vector) {
  return Json::Array({Rounded(vector.x()), Rounded(vector.y()), Rounded(vector.z())});
}

Json ShapeToJson(const Shape<Spatial>& shape) {
  Json json = {{"c", VectorToJson(shape.centre)}, {"r", Rounded(shape.radius_m)}};
  if (shape.half_extents == Vector::Zero()) return json;
  json["h"] = VectorToJson(shape.half_extents);
  json["axes"] = Json::Array();
  for (int i = 0; i < 3; ++i) json["axes"].Append(VectorToJson(shape.rotation.m.col(i)));
  return json;
}

Json ExtentToJson(const SpaceExtent& extent) {
  return Json::Array({VectorToJson(extent.low), VectorToJson(extent.high)});
}

/// How the motion is shown as a whole.
struct Overview {
  SpaceExtent motion = SpaceExtent::None();  ///< Of the robot in all frames.
  Vector reach = Vector::Zero();             ///< Of the robot from its root's origin, either way.
  double step_m = 0;                         ///< Of grids.
  double m_per_n = 0;                        ///< Of arrows.

  explicit Overview(const SpaceMotionPage& page) {
    double most_n = 0;
    for (const SpaceFrame& frame : page.frames) {
      const SpaceExtent extent = ExtentOf(page, frame);
      const Vector root = frame.poses.front().translation;
      motion.Add(extent.low);
      motion.Add(extent.high);
      for (int i = 0; i < 3; ++i)
        reach[i] = std::max({reach[i], root[i] - extent.low[i], extent.high[i] - root[i]});
      for (const SpaceContact& contact : frame.contacts)
        most_n = std::max(most_n, contact.force_n.norm());
    }
    step_m = NiceBelow(std::max(reach.x(), reach.y()) / 2);
    if (most_n > 0) m_per_n = 0.8 * reach.norm() / most_n;
  }
};

Json CarpetToJson(const SpaceCarpet& carpet) {
  return {{"origin", VectorToJson(carpet.origin)},
          {"along_s", VectorToJson(carpet.along_s)},
          {"along_t", VectorToJson(carpet.along_t)},
          {"normal", VectorToJson(carpet.normal)},
          {"s", carpet.s},
          {"t", carpet.t},
          {"outline", carpet.outline},
          {"ground", carpet.ground}};
}

Json FramesToJson(const SpaceMotionPage& page, Json json) {
  json["times_s"] = Json::Array();
  json["poses"] = Json::Array();
  json["contacts"] = Json::Array();
  for (const SpaceFrame& frame : page.frames) {
    json["times_s"].Append(Rounded(frame.time_s));
    Json poses = Json::Array(), contacts = Json::Array();
    for (const Pose& pose : frame.poses) {
      for (int i = 0; i < 3; ++i) poses.Append(Whole(pose.translation[i], 1e-4));
      for (const double part : QuaternionOf(pose.rotation)) poses.Append(Whole(part, 1e-4));
    }
    for (const SpaceContact& contact : frame.contacts) {
      for (int i = 0; i < 3; ++i) contacts.Append(Whole(contact.point_m[i], 1e-4));
      for (int i = 0; i < 3; ++i) contacts.Append(Whole(contact.force_n[i], 0.1));
    }
    json["poses"].Append(std::move(poses));
    json["contacts"].Append(std::move(contacts));
  }
  return json;
}

Json PlotToJson(const SpacePlot& plot) {
  Json json = {{"title", plot.title},
               {"unit", plot.unit},
               {"limits", plot.limits},
               {"series", Json::Array()}};
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const SpaceSeries& series = plot.series[s];
    double most = 0;
    for (const double value : series.values) most = std::max(most, std::abs(value));
    // Four digits of the largest: a curve is not drawn, and a value not read, to more.
    const double unit = most > 0 ? NiceBelow(most) / 1e4 : 1;
    double power = 1;
    while (power * unit < 0.999 && power < 1e9) power *= 10;
    Json values = Json::Array();
    for (const double value : series.values)
      values.Append(std::isnan(value) ? Json() : Json(std::round(value * power) / power));
    json["series"].Append({{"name", series.name},
                           {"hue", series.hue < 0 ? static_cast<int>(s % 8) : series.hue},
                           {"values", std::move(values)}});
  }
  return json;
}

Json ToJson(const SpaceMotionPage& page) {
  const Overview overview(page);
  Json json = {{"motion_s", Rounded(page.motion_s)},
               {"from_deg", Json::Array({kAzimuth_deg, kElevation_deg})},
               {"extent_m", ExtentToJson(overview.motion)},
               {"reach_m", VectorToJson(overview.reach)},
               {"step_m", overview.step_m},
               {"m_per_n", overview.m_per_n},
               {"bodies", Json::Array()},
               {"obstacles", Json::Array()},
               {"carpets", Json::Array()},
               {"plots", Json::Array()}};
  const std::vector<std::string> colours = BodyColours(page);
  for (std::size_t b = 0; b < page.bodies.size(); ++b) {
    Json shapes = Json::Array();
    for (const Shape<Spatial>& shape : page.bodies[b].shapes) shapes.Append(ShapeToJson(shape));
    json["bodies"].Append(
        {{"name", page.bodies[b].name}, {"colour", colours[b]}, {"shapes", shapes}});
  }
  for (const Obstacle<Spatial>& obstacle : page.obstacles) {
    if (obstacle.shape.half_space) continue;
    json["obstacles"].Append({{"name", obstacle.name},
                              {"colour", kObstacleColour},
                              {"shapes", Json::Array({ShapeToJson(obstacle.shape)})}});
  }
  SpaceExtent around = overview.motion;
  const Vector margin(1.5 * overview.step_m, 1.5 * overview.step_m, overview.step_m);
  around.Add(around.low - margin);
  around.Add(around.high + margin);
  for (const SpaceCarpet& carpet : CarpetsOf(page, around, overview.step_m))
    json["carpets"].Append(CarpetToJson(carpet));
  for (const SpacePlot& plot : page.plots) json["plots"].Append(PlotToJson(plot));
  return FramesToJson(page, std::move(json));
}

/// Poses side by side, each in a picture of the same size.
class Strip {
 public:
  Strip(const SpaceMotionPage& page, double width_px) : page_(page), overview_(page) {
    const double first = page.frames.front().time_s;
    const double end = std::clamp(page.motion_s, first, page.frames.back().time_s);
    for (std::size_t k = 0; k < kPoses; ++k) {
      const double t = first + (end - first) * static_cast<double>(k) / (kPoses - 1);
      frames_.push_back(&*std::ranges::min_element(
          page.frames, {}, [t](const SpaceFrame& frame) { return std::abs(frame.time_s - t); }));
    }
    double half_width = 1e-3, low = 0, high = 0;
    for (const SpaceFrame* frame : frames_) {
      const SpaceExtent extent = ExtentOf(page, *frame);
      for (int corner = 0; corner < 8; ++corner) {
        Vector p;
        for (int i = 0; i < 3; ++i) p[i] = (corner >> i & 1) != 0 ? extent.high[i] : extent.low[i];
        const Vector seen = camera_.view * (p - BelowRoot(*frame));
        half_width = std::max(half_width, std::abs(seen.x()));
        low = std::min(low, seen.y());
        high = std::max(high, seen.y());
      }
    }
    half_width *= 1.04;
    reach_m_ = 0.8 * half_width;
    width_px_ = width_px;
    camera_.px_per_m = width_px / (2 * half_width);
    camera_.m_per_n = overview_.m_per_n;
    above_px_ = camera_.px_per_m * (high + 0.06 * half_width);
    height_px_ = above_px_ + camera_.px_per_m * (0.06 * half_width - low);
  }

  [[nodiscard]] double width_px() const { return width_px_; }
  [[nodiscard]] double height_px() const { return height_px_; }
  [[nodiscard]] std::size_t size() const { return frames_.size(); }
  [[nodiscard]] std::string TimeOf(std::size_t i) const {
    return fmt::format("{:.2f} s", frames_[i]->time_s);
  }
  [[nodiscard]] double time_s(std::size_t i) const { return frames_[i]->time_s; }

  /// An element `svg`, which cuts off what is outside of it.
  [[nodiscard]] std::string Picture(std::size_t i, std::string_view attributes) const {
    const SpaceFrame& frame = *frames_[i];
    SpaceCamera camera = camera_;
    camera.target = BelowRoot(frame);
    SpaceExtent around = SpaceExtent::None();
    const Vector reach(reach_m_, reach_m_, reach_m_);
    around.Add(camera.target - reach);
    around.Add(camera.target + reach);
    return fmt::format(
        "<svg {} viewBox=\"{:.1f} {:.1f} {:.1f} {:.1f}\">{}</svg>", attributes, -width_px_ / 2,
        -above_px_, width_px_, height_px_,
        PaintFrame(page_, frame, CarpetsOf(page_, around, overview_.step_m), camera));
  }

 private:
  [[nodiscard]] Vector BelowRoot(const SpaceFrame& frame) const {
    const Vector& root = frame.poses.front().translation;
    return {root.x(), root.y(), overview_.motion.low.z()};
  }

  const SpaceMotionPage& page_;
  Overview overview_;
  std::vector<const SpaceFrame*> frames_;
  SpaceCamera camera_{SpaceView::From(kAzimuth_deg * std::numbers::pi / 180,
                                      kElevation_deg* std::numbers::pi / 180),
                      Vector::Zero()};
  double reach_m_ = 0, width_px_ = 0, above_px_ = 0, height_px_ = 0;
};

std::string PosesOf(const SpaceMotionPage& page) {
  const Strip strip(page, 150);
  std::string html = "<svg width=\"0\" height=\"0\" class=\"defs\" aria-hidden=\"true\"><defs>" +
                     SolidGradients(page) + "</defs></svg>\n<div id=\"poses\">\n";
  for (std::size_t i = 0; i < strip.size(); ++i) {
    const std::string time = strip.TimeOf(i);
    html += fmt::format(
        "<a class=\"pose\" href=\"#t={:.3f}\" data-t=\"{:.5f}\">{}<span "
        "class=\"pose-time\">{}</span></a>\n",
        strip.time_s(i), strip.time_s(i),
        strip.Picture(i, fmt::format("role=\"img\" aria-label=\"The robot at {}\"", time)), time);
  }
  return html + "</div>";
}

std::string FactsOf(const SpaceMotionPage& page) {
  if (page.facts.empty()) return "";
  std::string html = "<dl id=\"facts\">\n";
  for (const auto& [name, value] : page.facts)
    html += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", MarkupText(name), MarkupText(value));
  return html + "</dl>";
}

std::string NotesOf(const SpaceMotionPage& page) {
  std::istringstream lines(page.notes);
  std::string html;
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) html += "<p>" + MarkupText(line) + "</p>\n";
  }
  return html.empty() ? html
                      : "<section id=\"notes\" aria-label=\"Notes\">\n" + html + "</section>";
}

}  // namespace

std::string SpacePage(const SpaceMotionPage& page) {
  Check(page);
  return FillPlaces(SpaceReportPage(), {{"title", MarkupText(page.title)},
                                        {"subtitle", MarkupText(page.subtitle)},
                                        {"facts", FactsOf(page)},
                                        {"poses", PosesOf(page)},
                                        {"notes", NotesOf(page)},
                                        {"data", ScriptText(ToJson(page))}});
}

std::string SpaceFilmstrip(const SpaceMotionPage& page, int width_px) {
  Check(page);
  if (width_px < 200) RefuseField("width_px", fmt::format("is {}, must be at least 200", width_px));
  const std::size_t columns = width_px < kNarrow_px ? kPoses / 2 : kPoses;
  const Strip strip(page, static_cast<double>(width_px) / static_cast<double>(columns));
  const double row_px = strip.height_px() + 24;
  const std::size_t rows = kPoses / columns;
  const double height_px = row_px * static_cast<double>(rows);
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1:.0f}" viewBox="0 0 {0} {1:.0f}" role="img" aria-label="{2}">
<style>
.carpet {{ fill: #ece9e2; }} .shadow {{ fill: #c9c4b9; stroke: #c9c4b9; stroke-linejoin: round; }}
.grid {{ fill: none; stroke: #8d877b; stroke-opacity: .35; stroke-width: 1px; vector-effect: non-scaling-stroke; }}
.force {{ fill: none; stroke: #0a8560; stroke-width: 1.6px; }}
text {{ font: 12px system-ui, sans-serif; text-anchor: middle; fill: #626a73; }}
@media (prefers-color-scheme: dark) {{
  .carpet {{ fill: #24282c; }} .shadow {{ fill: #0f1114; stroke: #0f1114; }} .force {{ stroke: #35c496; }} text {{ fill: #9ba3ac; }}
}}
</style>
<defs>{3}</defs>
)",
      width_px, height_px, MarkupText(page.title), SolidGradients(page));
  for (std::size_t i = 0; i < strip.size(); ++i) {
    const std::size_t row = i / columns, column = i % columns;
    const double x = strip.width_px() * static_cast<double>(column);
    const double y = row_px * static_cast<double>(row);
    svg +=
        strip.Picture(i, fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"",
                                     x, y, strip.width_px(), strip.height_px()));
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + strip.width_px() / 2,
                       y + strip.height_px() + 17, strip.TimeOf(i));
  }
  return svg + "</svg>\n";
}

}  // namespace tumbler

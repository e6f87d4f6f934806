// The page of a motion in space without its scripts: what is in it, and the geometry of its
// pictures, by hand.

#include "offline/pages/space_page.h"

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/files/json.h"
#include "offline/pages/space_picture.h"
#include "tests/offline/sample_space_motion.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using Vector = SpaceVector;

constexpr double kDegree = std::numbers::pi / 180;

std::size_t CountOf(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

/// One body of these shapes at rest.
SpaceMotionPage Still(const std::vector<Shape<Spatial>>& shapes) {
  SpaceMotionPage page;
  page.title = "still";
  page.bodies = {{"body", shapes}};
  page.frames = {{0, {Pose{}}, {}}, {1, {Pose{}}, {}}};
  page.motion_s = 1;
  return page;
}

std::string Painted(const SpaceMotionPage& page, double azimuth_deg, double elevation_deg) {
  SpaceCamera camera{SpaceView::From(azimuth_deg * kDegree, elevation_deg * kDegree),
                     Vector::Zero()};
  camera.px_per_m = 100;
  camera.m_per_n = 0.01;
  return PaintFrame(page, page.frames.front(), {}, camera);
}

Json DataOf(const std::string& html) {
  const std::string open = "<script type=\"application/json\" id=\"data\">";
  const std::size_t from = html.find(open) + open.size();
  return Json::Parse(html.substr(from, html.find("</script>", from) - from)).value();
}

TEST(SpaceView, OfTheSideTheFrontAndTheTopHaveTheWorldsAxesWhereTheySay) {
  const Vector p(1, 2, 3);
  const auto seen = [&](double azimuth, double elevation) {
    return SpaceView::From(azimuth * kDegree, elevation * kDegree) * p;
  };
  EXPECT_LT((seen(0, 0) - Vector(1, 3, -2)).norm(), 1e-12);
  EXPECT_LT((seen(90, 0) - Vector(2, 3, 1)).norm(), 1e-12);
  EXPECT_LT((seen(0, 90) - Vector(1, 2, 3)).norm(), 1e-12);
  const SpaceView corner = SpaceView::From(30 * kDegree, 18 * kDegree);
  EXPECT_LT((corner.right.cross(corner.up) - corner.toward).norm(), 1e-12);
}

TEST(SpacePicture, HasASphereWhereItProjectsToWithItsRadius) {
  const SpaceMotionPage page = Still({Shape<Spatial>::Sphere({0.5, 2, 0.25}, 0.1)});
  EXPECT_THAT(Painted(page, 0, 0), HasSubstr("<circle cx=\"50\" cy=\"-25\" r=\"10\""));
  EXPECT_THAT(Painted(page, 90, 0), HasSubstr("<circle cx=\"200\" cy=\"-25\" r=\"10\""));
  // From 30 degrees above the side, up is (0, sin 30, cos 30): 2 x 0.5 + 0.25 x 0.866 = 1.2165.
  EXPECT_THAT(Painted(page, 0, 30), HasSubstr("<circle cx=\"50\" cy=\"-121.7\" r=\"10\""));
}

TEST(SpacePicture, PutsABodyIntoItsPose) {
  SpaceMotionPage page = Still({Shape<Spatial>::Sphere({0.3, 0, 0}, 0.1)});
  // A quarter of a turn about -y: x points up.
  page.frames.front().poses.front() = {Pose::RotationOf(0, -std::sqrt(0.5), 0, std::sqrt(0.5)),
                                       {1, 0, 1}};
  EXPECT_THAT(Painted(page, 0, 0), HasSubstr("<circle cx=\"100\" cy=\"-130\" r=\"10\""));
}

TEST(SpacePicture, ShowsTheSidesOfABoxThatTurnToTheViewer) {
  const SpaceMotionPage page = Still({Shape<Spatial>::Box({0, 0, 0}, {}, {0.3, 0.2, 0.1})});
  const std::string side = Painted(page, 0, 0);
  EXPECT_EQ(CountOf(side, "<path"), 1U) << side;
  for (const char* corner : {"30 10", "30 -10", "-30 -10", "-30 10"}) {
    EXPECT_THAT(side, HasSubstr(corner));
  }
  EXPECT_EQ(CountOf(Painted(page, 30, 0), "<path"), 2U);
  EXPECT_EQ(CountOf(Painted(page, 30, 20), "<path"), 3U);
}

TEST(SpacePicture, DrawsACapsuleAsABarWithRoundEndsAndOneThatIsSeenFromItsEndAsACircle) {
  const SpaceMotionPage page = Still({Shape<Spatial>::Capsule({0, 0, 0}, {}, 0.05, 0.1)});
  EXPECT_THAT(Painted(page, 0, 0),
              HasSubstr("<rect x=\"-10\" y=\"-10\" width=\"30\" height=\"20\" rx=\"10\" "
                        "transform=\"matrix(1 0 0 1 -5 0)\""));
  EXPECT_THAT(Painted(page, 90, 0), HasSubstr("<circle cx=\"0\" cy=\"0\" r=\"10\""));
}

TEST(SpacePicture, DrawsWhatIsNearerLater) {
  // Nearer to who sees it from the side is what has less y; from the front, what has more x.
  const SpaceMotionPage page =
      Still({Shape<Spatial>::Sphere({0, -1, 0}, 0.1), Shape<Spatial>::Sphere({-0.5, 1, 0}, 0.2)});
  const auto small_is_later = [&](double azimuth) {
    const std::string svg = Painted(page, azimuth, 0);
    return svg.find("r=\"10\"") > svg.find("r=\"20\"");
  };
  EXPECT_TRUE(small_is_later(0));
  EXPECT_TRUE(small_is_later(90));
  EXPECT_FALSE(small_is_later(180));
  EXPECT_FALSE(small_is_later(-90));
}

TEST(SpacePicture, DrawsWhatLiesOnALargeBoxAfterItAndWhatIsBelowItBefore) {
  // The middle of the box is nearer to the viewer than that of either ball.
  const SpaceMotionPage page = Still({Shape<Spatial>::Box({0, -0.5, 0}, {}, {1, 1, 0.1}),
                                      Shape<Spatial>::Sphere({0, 0.3, 0.2}, 0.1),
                                      Shape<Spatial>::Sphere({0, 0.3, -0.3}, 0.05)});
  const std::string svg = Painted(page, 10, 20);
  EXPECT_GT(svg.find("r=\"10\""), svg.rfind("<path"));
  EXPECT_LT(svg.find("r=\"5\""), svg.find("<path"));
}

TEST(SpacePicture, HasTheShadowOfABodyStraightBelowIt) {
  SpaceMotionPage page = Still({Shape<Spatial>::Sphere({0.5, 0.25, 0.75}, 0.1)});
  // Ground that rises by a half along x.
  page.obstacles = {{"ground", Shape<Spatial>::HalfSpace({0, 0, 0.1}, {-0.5, 0, 1})}};
  const std::vector<SpaceCarpet> carpets = CarpetsOf(page, {{-0.9, -0.9, 0}, {0.9, 0.9, 1}}, 0.5);
  ASSERT_EQ(carpets.size(), 1U);
  EXPECT_EQ(carpets[0].s[0], -1);
  EXPECT_EQ(carpets[0].t[1], 1);
  SpaceCamera camera{SpaceView::From(0, 30 * kDegree), Vector::Zero()};
  const std::string svg = PaintFrame(page, page.frames.front(), carpets, camera);
  // s and t are x and y; z is 0.1 + x / 2, and up is (0, sin 30, cos 30).
  EXPECT_THAT(svg, HasSubstr("<g transform=\"matrix(100 -43.301 0 -50 0 -8.66)\""));
  EXPECT_THAT(svg, HasSubstr("<path d=\"M0.5 0.25z\" stroke-width=\"0.2\"/>"));
}

TEST(SpacePicture, CutsGroundOffAtAWallAndTheWallAtTheGround) {
  SpaceMotionPage page = Still({Shape<Spatial>::Sphere({0, 0, 0.5}, 0.1)});
  page.obstacles = {{"ground", Shape<Spatial>::HalfSpace({0, 0, 0.25}, {0, 0, 1})},
                    {"wall", Shape<Spatial>::HalfSpace({0, 0.5, 0}, {0, -1, 0})},
                    {"ground below", Shape<Spatial>::HalfSpace({0, 0, -1}, {0, 0, 1})}};
  const std::vector<SpaceCarpet> carpets = CarpetsOf(page, {{-1, -1, -1}, {1, 1, 1}}, 1);
  ASSERT_EQ(carpets.size(), 2U) << "the ground below is inside the other";
  const auto extent_of = [](const SpaceCarpet& carpet) {
    SpaceExtent extent = SpaceExtent::None();
    for (const auto& [s, t] : carpet.outline)
      extent.Add(carpet.origin + s * carpet.along_s + t * carpet.along_t);
    return extent;
  };
  EXPECT_LT((extent_of(carpets[0]).low - Vector(-1, -1, 0.25)).norm(), 1e-6);
  EXPECT_LT((extent_of(carpets[0]).high - Vector(1, 0.5, 0.25)).norm(), 1e-6);
  EXPECT_LT((extent_of(carpets[1]).low - Vector(-1, 0.5, 0.25)).norm(), 1e-6);
  EXPECT_LT((extent_of(carpets[1]).high - Vector(1, 0.5, 1)).norm(), 1e-6);
  // From the wall's back, its grid alone.
  const auto fills = [&](double azimuth) {
    SpaceCamera camera{SpaceView::From(azimuth * kDegree, 20 * kDegree), Vector::Zero()};
    return CountOf(PaintFrame(page, page.frames.front(), carpets, camera), "class=\"carpet\"");
  };
  EXPECT_EQ(fills(0), 2U);
  EXPECT_EQ(fills(180), 1U);
}

TEST(SpacePicture, HasAnArrowForAForceFromItsPoint) {
  SpaceMotionPage page = Still({Shape<Spatial>::Sphere({0, 0, 0}, 0.1)});
  page.frames.front().contacts = {{{0.2, 0, -0.1}, {0, 0, 50}}};
  // 0.01 m per N: 50 pixels up.
  EXPECT_THAT(Painted(page, 0, 0), HasSubstr("<path class=\"force\" d=\"M20 10L20 -40M"));
}

TEST(SpacePage, IsOneSmallFileOfATwoSecondMotionThatAsksTheNetworkForNothing) {
  const std::string html = SpacePage(SampleSpaceMotion());
  EXPECT_LT(html.size(), 400'000U);
  for (const char* asks : {"src=\"", "href=\"http", "@import", "url(\"", "fetch("}) {
    EXPECT_THAT(html, Not(HasSubstr(asks)));
  }
  EXPECT_THAT(html, Not(HasSubstr("{{")));
}

TEST(SpacePage, HasItsTextsAndPosesWithoutScripts) {
  const std::string html = SpacePage(SampleSpaceMotion());
  EXPECT_THAT(html, HasSubstr("<h1 id=\"title\">trot around a bend</h1>"));
  EXPECT_THAT(html, HasSubstr("<dt>Lowest clearance</dt><dd>12 mm</dd>"));
  EXPECT_THAT(html, HasSubstr("<p>Its feet do not slip while they stand.</p>"));
  EXPECT_EQ(CountOf(html, "class=\"pose\" href"), 8U);
  // Frames are 1/60 s apart: 2/7 s is nearest to that at 17/60 s.
  for (const char* time : {"0.00 s", "0.28 s", "2.00 s"}) {
    EXPECT_THAT(html, HasSubstr(std::string("aria-label=\"The robot at ") + time));
  }
}

TEST(SpacePage, KeepsPosesForcesAndCurvesToTheDigitsThatAreSeen) {
  const SpaceMotionPage page = SampleSpaceMotion();
  const Json data = DataOf(SpacePage(page));
  ASSERT_EQ(data["poses"].size(), page.frames.size());
  for (const std::size_t i : {std::size_t{0}, std::size_t{37}, page.frames.size() - 1}) {
    const SpaceFrame& frame = page.frames[i];
    for (std::size_t b = 0; b < page.bodies.size(); ++b) {
      const auto part = [&](std::size_t k) { return 1e-4 * data["poses"][i][7 * b + k].number(); };
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(part(static_cast<std::size_t>(k)), frame.poses[b].translation[k], 5.1e-5);
      const SpaceMatrix R = Pose::RotationOf(part(3), part(4), part(5), part(6));
      for (int c = 0; c < 3; ++c)
        EXPECT_LT((R.col(c) - frame.poses[b].rotation.col(c)).norm(), 5e-4) << i << ' ' << b;
    }
    ASSERT_EQ(data["contacts"][i].size(), 6 * frame.contacts.size());
  }
  const double knee = data["plots"][2]["series"][1]["values"][37].number();
  EXPECT_NEAR(knee, page.plots[2].series[1].values[37], 1e-4);
}

TEST(SpacePage, DrawsNoValueWhereThereIsNone) {
  SpaceMotionPage page = SampleSpaceMotion();
  page.plots[0].series[0].values[0] = std::numeric_limits<double>::quiet_NaN();
  const Json values = DataOf(SpacePage(page))["plots"][0]["series"][0]["values"];
  EXPECT_TRUE(values[0].is_null());
  EXPECT_FALSE(values[1].is_null());
}

TEST(SpacePage, ShowsHostileTextsAsTexts) {
  SpaceMotionPage page = SampleSpaceMotion();
  const std::string hostile = "</script><script>alert(1)</script>{{data}}<b title=\"";
  page.title = page.subtitle = page.notes = hostile;
  page.facts = {{hostile, hostile}};
  page.bodies[0].name = page.obstacles[1].name = hostile;
  page.plots[0].title = page.plots[0].series[0].name = hostile;
  const std::string html = SpacePage(page);
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html, Not(HasSubstr("<b title")));
  EXPECT_EQ(CountOf(html, "id=\"data\">{"), 1U);
  EXPECT_EQ(DataOf(html)["bodies"][0]["name"].text(), hostile);
  EXPECT_THAT(SpaceFilmstrip(page, 800), Not(HasSubstr("<script")));
}

TEST(SpacePage, RefusesWhatItCannotShowAndNamesIt) {
  const auto refusal = [](auto change) {
    SpaceMotionPage page = SampleSpaceMotion();
    change(page);
    try {
      SpacePage(page);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  EXPECT_EQ(refusal([](auto&) {}), "taken");
  EXPECT_THAT(refusal([](auto& page) { page.frames[3].poses.pop_back(); }),
              HasSubstr("frames[3].poses: has 12 entries, must have 13: one for each body"));
  EXPECT_THAT(refusal([](auto& page) { page.frames[2].time_s = page.frames[1].time_s; }),
              HasSubstr("frames[2].time_s"));
  EXPECT_THAT(refusal([](auto& page) {
                page.frames[5].poses[4].translation[1] = std::numeric_limits<double>::quiet_NaN();
              }),
              HasSubstr("frames[5].poses[4].translation[1]: is nan, must be finite"));
  EXPECT_THAT(refusal([](auto& page) { page.bodies[2].hue = 8; }), HasSubstr("bodies[2].hue"));
  EXPECT_THAT(refusal([](auto& page) { page.plots[1].series[0].values.pop_back(); }),
              HasSubstr("plots[1].series[0].values"));
  EXPECT_THAT(refusal([](auto& page) { page.frames.resize(1); }), HasSubstr("frames"));
  EXPECT_THAT(refusal([](auto& page) { page.bodies[1].shapes = {page.obstacles[0].shape}; }),
              HasSubstr("bodies[1].shapes[0]: is a half-space"));
}

TEST(SpaceFilmstrip, HasEightPosesInOneRowOrInTwoWhereItIsNarrow) {
  const SpaceMotionPage page = SampleSpaceMotion();
  const auto rows = [&](int width) {
    const std::string svg = SpaceFilmstrip(page, width);
    EXPECT_EQ(CountOf(svg, "viewBox"), 9U);
    EXPECT_EQ(CountOf(svg, "</text>"), 8U);
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
    return CountOf(svg, "x=\"0.0\" y=");
  };
  EXPECT_EQ(rows(1000), 1U);
  EXPECT_EQ(rows(400), 2U);
  EXPECT_THROW(SpaceFilmstrip(page, 100), std::invalid_argument);
}

TEST(SpaceFilmstrip, RefersToNoGradientThatItHasNot) {
  const std::string svg = SpaceFilmstrip(SampleSpaceMotion(), 1000);
  const std::regex reference("url\\(#([a-z0-9-]+)\\)");
  std::size_t count = 0;
  for (std::sregex_iterator it(svg.begin(), svg.end(), reference), end; it != end; ++it, ++count)
    EXPECT_THAT(svg, HasSubstr("id=\"" + (*it)[1].str() + "\""));
  EXPECT_GT(count, 100U);
}

}  // namespace
}  // namespace tumbler

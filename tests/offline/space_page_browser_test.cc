// The page of a motion in space in a headless browser without a network.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <cstddef>
#include <string>

#include "offline/pages/space_page.h"
#include "tests/offline/sample_space_motion.h"
#include "tests/support/browser.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::TextOf;

/// What the probes share: a sum of the stage's pixels, and the colour at a point of the world.
constexpr const char* kPixels = R"(
  const canvas = byId('stage');
  const picture = () => {
    const {data} = canvas.getContext('2d', {willReadFrequently: true}).getImageData(0, 0, canvas.width, canvas.height);
    let sum = 0;
    for (const pixel of new Uint32Array(data.buffer)) sum = (31 * sum + pixel) | 0;
    return sum;
  };
  let last = picture();
  const changed = () => { const now = picture(); const is = now !== last; last = now; return is; };
  const hueAt = (point) => {
    const [x, y] = stage.at(point).map((v) => Math.round(v * stage.ratio));
    const [r, g, b, a] = canvas.getContext('2d').getImageData(x, y, 1, 1).data;
    return a === 0 ? 'paper' : r > 1.3 * b ? 'orange' : b > 1.3 * r ? 'blue' : r > 230 ? 'carpet' : 'grey';
  };
  const press = (key, target = canvas) => target.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true}));
  const point = (type, x, y, pointerId = 1) => canvas.dispatchEvent(
    new PointerEvent(type, {pointerId, button: 0, clientX: x, clientY: y, bubbles: true}));
  const angles = () => `${stage.azimuth.toFixed(1)} ${stage.elevation.toFixed(1)}`;
)";

class SpacePageInBrowser : public ::testing::Test {
 protected:
  std::string Browse(const SpaceMotionPage& page, const std::string& fragment,
                     const std::string& probe, int width = 1000) {
    const std::string path = folder_ / "index.html";
    testing::WriteFile(path, SpacePage(page));
    std::string dom = testing::BrowsePage(path, std::filesystem::path(path).parent_path().string(),
                                          fragment, kPixels + probe, width);
    EXPECT_EQ(TextOf(dom, "errors"), "");
    return dom;
  }
  std::string Probe(const SpaceMotionPage& page, const std::string& fragment,
                    const std::string& probe, int width = 1000) {
    return TextOf(Browse(page, fragment, probe, width), "probe");
  }

  testing::TemporaryFolder folder_;
};

/// Two balls, orange and blue, at rest.
SpaceMotionPage TwoBalls(const SpaceVector& orange, const SpaceVector& blue) {
  SpaceMotionPage page;
  page.bodies = {{"orange", {Shape<Spatial>::Sphere(orange, 0.1)}, 0},
                 {"blue", {Shape<Spatial>::Sphere(blue, 0.1)}, 1}};
  page.frames = {{0, {Pose{}, Pose{}}, {}}, {1, {Pose{}, Pose{}}, {}}};
  page.motion_s = 1;
  return page;
}

TEST_F(SpacePageInBrowser, TurnsByDraggingAndByKeysAndComesNearerByWheelFingersAndKeys) {
  EXPECT_EQ(Probe(SampleSpaceMotion(), "t=0.5&from=30,20", R"(
    const step = (name, act) => { act(); say(name, angles(), stage.zoom.toFixed(2), changed()); };
    step('nothing', () => {});
    step('drag', () => { point('pointerdown', 200, 400); point('pointermove', 300, 440); point('pointerup', 300, 440); });
    step('released', () => point('pointermove', 500, 440));
    step('scrolled', () => { point('pointerdown', 200, 400); point('pointermove', 200, 440); point('pointercancel', 200, 440); });
    step('left', () => press('ArrowLeft'));
    step('up', () => press('ArrowUp'));
    step('plus', () => press('+'));
    step('minus', () => press('-'));
    canvas.focus();
    step('wheel', () => canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: -200, cancelable: true})));
    canvas.blur();
    step('wheel elsewhere', () => canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: -200, cancelable: true})));
    step('fingers', () => {
      point('pointerdown', 200, 400, 1); point('pointerdown', 300, 400, 2);
      point('pointermove', 150, 400, 1); point('pointermove', 350, 400, 2);
      point('pointerup', 150, 400, 1); point('pointerup', 350, 400, 2);
    });
    step('button', () => byId('size').querySelector('[data-value="-1"]').click());
    step('top', () => { for (let k = 0; k < 10; ++k) press('ArrowUp'); });
    say(byId('time').textContent);)"),
            "nothing 30.0 20.0 1.00 false\n"
            "drag -15.0 38.0 1.00 true\n"
            "released -15.0 38.0 1.00 false\n"
            "scrolled -15.0 38.0 1.00 false\n"
            "left -10.0 38.0 1.00 true\n"
            "up -10.0 43.0 1.00 true\n"
            "plus -10.0 43.0 1.20 true\n"
            "minus -10.0 43.0 1.00 true\n"
            "wheel -10.0 43.0 1.35 true\n"
            "wheel elsewhere -10.0 43.0 1.35 false\n"
            "fingers -10.0 43.0 2.70 true\n"
            "button -10.0 43.0 2.25 true\n"
            "top -10.0 90.0 2.25 true\n"
            "0.500 s\n");
}

TEST_F(SpacePageInBrowser, ButtonsLookFromTheSideTheFrontAndTheTop) {
  EXPECT_EQ(Probe(SampleSpaceMotion(), "t=0.5", R"(
    const pressed = () => byId('from').querySelector('[aria-pressed="true"]')?.dataset.value;
    const way = (v) => { const [a, b] = [stage.at([0, 0, 0]), stage.at(v)]; return `${Math.sign(Math.round(b[0] - a[0]))},${Math.sign(Math.round(a[1] - b[1]))}`; };
    for (const name of ['side', 'front', 'top', 'corner']) {
      byId('from').querySelector(`[data-value="${name}"]`).click();
      say(pressed(), angles(), 'x', way([1, 0, 0]), 'y', way([0, 1, 0]), 'z', way([0, 0, 1]), changed());
    }
    press('ArrowLeft');
    say(pressed() ?? 'none');)"),
            "side 0.0 0.0 x 1,0 y 0,0 z 0,1 true\n"
            "front 90.0 0.0 x 0,0 y 1,0 z 0,1 true\n"
            "top 0.0 90.0 x 1,0 y 0,1 z 0,0 true\n"
            "corner 30.0 18.0 x 1,-1 y 1,1 z 0,1 true\n"
            "none\n");
}

TEST_F(SpacePageInBrowser, PlaysAndTheSliderKeysAndPosesMoveTheRobot) {
  const SpaceMotionPage page = SampleSpaceMotion();
  EXPECT_EQ(Probe(page, "t=0.5", R"(
    say('at first', state.playing);
    const now = (name) => say(name, byId('time').textContent, byId('phase').textContent, changed());
    byId('slider').value = 0.8; byId('slider').dispatchEvent(new Event('input')); now('slider');
    press('ArrowRight', document.body); now('right');
    press('End', document.body); now('end');
    document.querySelectorAll('.pose')[1].click(); now('pose');
    say(document.querySelector('.pose.current .pose-time').textContent);
    byId('speed').querySelector('[data-value="0.25"]').click();
    press(' '); frame(1000); frame(1080); now('played'); press(' ');
    const [x] = cells.root;
    say(x.textContent);)"),
            fmt::format("at first false\nslider 0.800 s  true\nright 0.817 s  true\n"
                        "end 2.300 s after the motion true\npose 0.283 s  true\n0.28 s\n"
                        "played 0.303 s  true\n{:.3f}\n",
                        page.frames[18].poses[0].translation.x() +
                            (0.30333 - 0.3) * 60 *
                                (page.frames[19].poses[0].translation.x() -
                                 page.frames[18].poses[0].translation.x())));
}

TEST_F(SpacePageInBrowser, ShowsWhatIsNearerAndOfWhatGoesThroughEachOtherBothParts) {
  // One before the other, along y.
  EXPECT_EQ(Probe(TwoBalls({0, -0.3, 0}, {0, 0.3, 0}), "from=0,0", R"(
    say(hueAt([0, 0, 0]));
    lookFrom(180, 0); redraw(); say(hueAt([0, 0, 0]));
    lookFrom(90, 0); reset(); say(hueAt([0, 0, 0]), hueAt([0, -0.3, 0]), hueAt([0, 0.3, 0]));)"),
            "orange\nblue\npaper orange blue\n");
  // Halves: they meet in the plane x = 0.
  EXPECT_EQ(Probe(TwoBalls({-0.05, 0, 0}, {0.05, 0, 0}), "from=0,0",
                  "say(hueAt([-0.01, 0, 0]), hueAt([0.01, 0, 0]));"),
            "orange blue\n");
}

TEST_F(SpacePageInBrowser, DrawsEachKindOfSolidAsFarAsItReachesAndGroundHidesWhatIsBelow) {
  SpaceMotionPage page = TwoBalls({0, 0, -1}, {0, 0, -1});
  Shape<Spatial> rounded = Shape<Spatial>::Box({1, 0, 0}, {}, {0.2, 0.1, 0.1});
  rounded.radius_m = 0.1;
  page.bodies[0].shapes = {Shape<Spatial>::Box({0, 0, 0}, {}, {0.2, 0.1, 0.1}), rounded};
  page.bodies[1].shapes = {Shape<Spatial>::Capsule({-1, 0, 0}, {}, 0.2, 0.1)};
  EXPECT_EQ(Probe(page, "from=0,0", R"(
    const row = (points) => say(points.map(([x, z]) => hueAt([x, 0, z])).join(' '));
    row([[0.18, 0.08], [0.22, 0.08], [0.18, 0.12]]);
    row([[1.28, 0], [1.32, 0], [1.18, 0.18], [1.28, 0.18], [1, 0.18], [1, 0.22]]);
    row([[-1.28, 0], [-1.32, 0], [-1.18, 0.08], [-1.28, 0.08]]);)"),
            "orange paper paper\n"
            "orange paper orange paper orange paper\n"
            "blue paper blue paper\n");
  page.obstacles = {{"ground", Shape<Spatial>::HalfSpace({0, 0, 0}, {0, 0, 1})}};
  EXPECT_EQ(Probe(page, "from=0,30", "say(hueAt([0.07, -0.1, 0.05]), hueAt([0.07, -0.1, -0.05]));"),
            "orange carpet\n");
}

TEST_F(SpacePageInBrowser, FitShowsTheWholeMotionFromEverySideAndFollowKeepsTheRobotInside) {
  EXPECT_EQ(Probe(SampleSpaceMotion(), "camera=fit", R"(
    const inside = (p) => { const [x, y] = stage.at(p); return x >= 0 && x <= stage.width && y >= 0 && y <= stage.height; };
    const robotInside = (t) => { seek(t); return motion.poses(t).every((pose) => inside(pose.at)); };
    const click = (id, value) => byId(id).querySelector(`[data-value="${value}"]`).click();
    for (const camera of ['fit', 'follow']) {
      click('camera', camera);
      for (const from of ['side', 'front', 'top', 'corner']) {
        click('from', from);
        say(camera, from, motion.times.filter((_, i) => i % 23 === 0).every(robotInside));
      }
    }
    seek(1); changed(); click('ends', 'ends'); say(changed());)"),
            "fit side true\nfit front true\nfit top true\nfit corner true\n"
            "follow side true\nfollow front true\nfollow top true\nfollow corner true\ntrue\n");
}

TEST_F(SpacePageInBrowser, FitsEveryWidthByDayAndByNight) {
  for (const int width : {400, 760, 1200}) {
    std::string pictures;
    for (const std::string theme : {"light", "dark"}) {
      const std::string probe = Probe(SampleSpaceMotion(), "t=0.5&theme=" + theme, R"(
        const beyond = [...document.body.querySelectorAll('*')].filter((e) => e.id !== 'probe' && !(e.closest('svg') && e.tagName !== 'svg'))
          .filter((e) => e.getBoundingClientRect().right > innerWidth + 0.5);
        say(innerWidth, document.documentElement.scrollWidth <= innerWidth, beyond.map((e) => e.outerHTML.slice(0, 60)).join());
        const small = [...document.querySelectorAll('p, td, th, dd, dt, span, text, button')].filter((e) => e.textContent.trim() && parseFloat(getComputedStyle(e).fontSize) < 10);
        say(small.length, canvas.width >= 0.8 * innerWidth - 80 || innerWidth > 1000);
        say(picture() + getComputedStyle(document.body).backgroundColor);)",
                                      width);
      EXPECT_THAT(probe, HasSubstr(fmt::format("{} true \n0 true\n", width)));
      EXPECT_NE(probe, pictures);
      pictures = probe;
    }
  }
}

TEST_F(SpacePageInBrowser, WithoutScriptsItShowsThePosesAndNothingThatDoesNotWork) {
  EXPECT_EQ(Probe(SampleSpaceMotion(), "", R"(
    document.documentElement.classList.remove('scripts');
    say(['header', '#facts', '#poses', '#notes', '#motion', '#histories', 'footer']
      .filter((s) => document.querySelector(s).getClientRects().length > 0).join(' '));)"),
            "header #facts #poses #notes\n");
}

TEST_F(SpacePageInBrowser, ARobotWithoutContactsPlotsGroundOrFactsHasAPageToo) {
  EXPECT_EQ(Probe(TwoBalls({0, 0, 0}, {0.5, 0, 0}), "view=robot", R"(
    say(byId('contact').hidden, byId('histories').hidden, document.querySelectorAll('#legend li').length);
    say(canvas.getBoundingClientRect().height === innerHeight);)"),
            "true true 1\ntrue\n");
}

TEST_F(SpacePageInBrowser, ShowsHostileTextAsText) {
  SpaceMotionPage page = SampleSpaceMotion();
  const std::string hostile = "</script><script>say('ran')</script><img src=x onerror=say('ran')>";
  page.title = page.notes = page.bodies[0].name = page.plots[0].series[0].name = hostile;
  EXPECT_EQ(Probe(page, "",
                  "say(byId('root').querySelector('th span').textContent === "
                  "byId('title').textContent);"),
            "true\n");
}

}  // namespace
}  // namespace tumbler

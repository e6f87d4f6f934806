// The report's page in a headless browser without a network: how its scripts show the data. The
// page's own error handler writes script errors into the document. A test may add a script that
// works the page and writes what it finds.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "offline/pages/report.h"
#include "tests/offline/sample_motion.h"
#include "tests/support/browser.h"

namespace tumbler {
namespace {

using testing::Count;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TextOf;

std::string Fixed(double value, int digits) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  std::string shown = text.data();
  if (shown[0] == '-') shown.replace(0, 1, "\u2212");  // The page shows true minus signs.
  return shown;
}

class ReportInBrowser : public ::testing::Test {
 protected:
  // A directory whose name an address cannot hold as it is.
  ReportInBrowser()
      : directory_(::testing::TempDir() + "tumbler report #" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
  }
  ~ReportInBrowser() override { std::filesystem::remove_all(directory_); }

  /// The document of the page with this fragment in its address, after its scripts and then `probe`
  /// ran. Everything that the probe passes to `say` is the text of element `probe`.
  std::string Browse(const ReportData& data, const std::string& fragment,
                     const std::string& probe = "", int width = 1200) {
    return testing::BrowsePage(WriteReport(data, directory_), directory_, fragment, probe, width);
  }

  std::string directory_;
};

TEST_F(ReportInBrowser, StandsStillAtTheTimeOfItsAddress) {
  const ReportData data = SampleMotion();
  const std::string dom = Browse(data, "t=0.75");
  EXPECT_EQ(TextOf(dom, "time"), "0.750 s");
  EXPECT_EQ(TextOf(dom, "phase"), "");
  EXPECT_EQ(TextOf(dom, "title"), "handstand");
  EXPECT_EQ(TextOf(dom, "errors"), "");
  EXPECT_THAT(dom, HasSubstr("aria-label=\"Play\""));

  const ReportSample& sample = data.samples[150];
  ASSERT_DOUBLE_EQ(sample.time_s, 0.75);
  for (std::size_t j = 0; j < 2; ++j) {
    EXPECT_THAT(dom, HasSubstr("<span>" + data.joint_names[j] + "</span></th><td>" +
                               Fixed(sample.joint_positions_rad[j], 3) + "</td><td>" +
                               Fixed(sample.joint_velocities_rad_s[j], 2) + "</td><td>" +
                               Fixed(sample.joint_torques_nm[j], 2) + "</td>"));
  }
  EXPECT_THAT(dom, HasSubstr("<span>middle</span></th><td>" + Fixed(sample.link_poses[0][0], 3) +
                             "</td><td>" + Fixed(sample.link_poses[0][1], 3) + "</td><td>" +
                             Fixed(sample.root_pitch_rad, 3) + "</td>"));
  double normal = 0;
  double friction = 0;
  for (const ReportSample::Force& force : sample.forces) {
    normal += force.fz_n;
    friction += force.fx_n;
  }
  EXPECT_THAT(dom, HasSubstr("<span>sum</span></th><td>" + std::to_string(sample.forces.size()) +
                             "</td><td>" + Fixed(normal, 1) + "</td><td>" + Fixed(friction, 1)));
}

TEST_F(ReportInBrowser, HasAllItsPartsWithUnits) {
  const ReportData data = SampleMotion();
  const std::string dom = Browse(data, "");
  EXPECT_EQ(TextOf(dom, "time"), "0.000 s");
  EXPECT_EQ(Count(dom, "class=\"pose-time\""), 8U);
  for (const char* time :
       {"0.00 s", "0.17 s", "0.34 s", "0.51 s", "0.69 s", "0.86 s", "1.03 s", "1.20 s"}) {
    EXPECT_THAT(dom, HasSubstr(std::string("class=\"pose-time\">") + time + "<"));
  }
  for (const char* plot : {"Joint angle<i>rad", "Joint velocity<i>rad/s", "Joint torque<i>N·m",
                           "Contact force<i>N", "Root pitch<i>rad", "Root position<i>m",
                           "Cost<i>log scale", "Largest violation<i>log scale"}) {
    EXPECT_THAT(dom, HasSubstr(std::string("<span class=\"name\">") + plot + "</i>"));
  }
  EXPECT_EQ(Count(dom, ">settling</text>"), 6U);
  EXPECT_EQ(Count(dom, ">time [s]</text>"), 6U);
  EXPECT_EQ(Count(dom, ">evaluation</text>"), 2U);
  EXPECT_EQ(Count(dom, ">limit 8.0</text>"), 1U);
  EXPECT_EQ(Count(dom, ">limit \u22122.90</text>"), 1U);
  for (const auto& [name, value] : data.certificate) {
    EXPECT_THAT(
        dom, HasSubstr(
                 std::string("<th scope=\"row\">").append(name).append("</th><td>").append(value)));
  }
  double peak = 0;
  for (const ReportSample& sample : data.samples) {
    for (const double torque : sample.joint_torques_nm) peak = std::max(peak, std::abs(torque));
  }
  EXPECT_THAT(dom, HasSubstr("<dt>Peak torque</dt><dd>" + Fixed(peak, 2) + "<i> N·m</i>"));
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(ReportInBrowser, SaysWhatTheSearchSaysAndNotWhatItsSamplesHappenToShow) {
  ReportData data = SampleMotion();
  data.settle_s = 0.1;  // of the 0.3 s that are shown
  data.evaluation_count = 7456;
  data.peak_torque = ReportPeak{1, 0.7512, 7.78};  // between two samples
  data.minima = {{"#", "cost"}, {{"1", "0.0004"}, {"2", "0.0007, refused: <b>"}}};
  data.window = {{"property", "from", "to"}, {{"friction", "0.1 or less", "0.6"}}};
  data.window_note = "Each by itself, <b>.";
  const std::string dom = Browse(data, "t=1.25", R"(
    const fact = (name) => [...byId('facts').children].find((d) => d.firstChild.textContent === name).textContent;
    for (const name of ['Duration', 'Peak torque', 'Evaluations']) say(fact(name));
    const phases = []; for (const t of [1.2, 1.25, 1.35]) { seek(t); phases.push(byId('phase').textContent); }
    say(phases.join());
    for (const table of ['#minima', '#ground-window'])
      say([...document.querySelectorAll(table + ' tr')].map((r) => [...r.cells].map((c) => c.textContent).join('|')).join(' / '));
    say(byId('ground-window').querySelector('p').textContent);
    say(getComputedStyle(byId('minima')).display, getComputedStyle(byId('ground-window')).display);)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "Duration1.200 sthen 0.100 s of settling; shown until 0.300 s later\n"
            "Peak torque7.78 N·mleg_2 at 0.751 s, 97 % of its limit\n"
            "Evaluations7456shown: 1500 search, " +
                std::to_string(data.evaluations.size() - 1500) +
                " local solver; the others: of other starts, or failed\n"
                ",settling,held\n"
                "#|cost / 1|0.0004 / 2|0.0007, refused: &lt;b&gt;\n"
                "property|from|to / friction|0.1 or less|0.6\n"
                "Each by itself, &lt;b&gt;.\n"
                "block block\n");
}

TEST_F(ReportInBrowser, DrawsEachLinkWhereThePoseSaysWithUpwardsUp) {
  const ReportData data = SampleMotion();
  const std::string dom = Browse(data, "t=0.6", R"(
    for (const k of [0, 1, 2]) {
      const link = stage.robot.links[k];
      const m = stage.world.getCTM().inverse().multiply(link.getCTM());
      const point = new DOMPoint(0.2, 0.04).matrixTransform(m);
      const above = new DOMPoint(point.x, point.y + 0.1).matrixTransform(stage.world.getScreenCTM());
      const here = new DOMPoint(point.x, point.y).matrixTransform(stage.world.getScreenCTM());
      say(point.x, point.y, above.y < here.y ? 'up' : 'down');
    })");
  std::istringstream probe(TextOf(dom, "probe"));
  for (const std::array<double, 3>& pose : data.samples[120].link_poses) {
    double x = 0;
    double z = 0;
    std::string direction;
    ASSERT_TRUE(probe >> x >> z >> direction) << TextOf(dom, "probe");
    EXPECT_NEAR(x, pose[0] + 0.2 * std::cos(pose[2]) - 0.04 * std::sin(pose[2]), 1e-4);
    EXPECT_NEAR(z, pose[1] + 0.2 * std::sin(pose[2]) + 0.04 * std::cos(pose[2]), 1e-4);
    EXPECT_EQ(direction, "up");
  }
}

TEST_F(ReportInBrowser, FitShowsTheWholeMotionAndFollowKeepsTheRobotInView) {
  // The motion, carried 3 m to the right on its way.
  ReportData data = SampleMotion();
  for (ReportSample& sample : data.samples) {
    for (std::array<double, 3>& pose : sample.link_poses) pose[0] += 2 * sample.time_s;
    for (ReportSample::Force& force : sample.forces) force.x_m += 2 * sample.time_s;
  }
  const std::string look = R"(
    const view = byId('stage').getBoundingClientRect();
    const reaches = (t) => {
      seek(t);
      const box = stage.robot.group.getBoundingClientRect();
      return box.left >= view.left && box.right <= view.right && box.top >= view.top && box.bottom <= view.bottom;
    };
    say(stage.camera, motion.times.every(reaches), stage.scale.toFixed(0));)";
  const auto probed = [&](const std::string& fragment) {
    std::istringstream words(TextOf(Browse(data, fragment, look), "probe"));
    std::string camera;
    std::string inside;
    double scale = 0;
    words >> camera >> inside >> scale;
    EXPECT_EQ(inside, "true") << fragment;
    return std::pair(camera, scale);
  };
  const auto [chosen, chosen_scale] = probed("");
  const auto [fit, fit_scale] = probed("camera=fit");
  EXPECT_EQ(chosen, "follow") << "a motion much longer than the robot";
  EXPECT_EQ(fit, "fit");
  EXPECT_GT(chosen_scale, 2 * fit_scale);
}

TEST_F(ReportInBrowser, KeysAndControlsMoveTheTime) {
  const std::string dom = Browse(SampleMotion(), "t=0.5", R"(
    const press = (key, shiftKey = false) => document.body.dispatchEvent(new KeyboardEvent('keydown', {key, shiftKey, bubbles: true}));
    const now = () => byId('time').textContent;
    press('ArrowRight'); say('right', now());
    press('ArrowLeft'); press('ArrowLeft'); say('left', now());
    press('ArrowRight', true); say('shift-right', now());
    press('End'); say('end', now(), byId('phase').textContent);
    press('ArrowRight'); say('beyond', now());
    press('Home'); say('home', now());
    press(' '); say('space', byId('play').getAttribute('aria-label'), state.playing);
    press(' '); say('space', byId('play').getAttribute('aria-label'), state.playing);
    byId('slider').value = 0.8; byId('slider').dispatchEvent(new Event('input')); say('slider', now());
    document.querySelectorAll('.pose')[7].click(); say('pose', now(), document.querySelector('.pose.current .pose-time').textContent);
    byId('speed').querySelector('[data-value="0.1"]').click(); say('speed', state.speed);
    press(' ');
    frame(1000); frame(1050); say('played', now());
    press(' ');)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "right 0.505 s\nleft 0.495 s\nshift-right 0.595 s\nend 1.500 s settling\n"
            "beyond 1.500 s\nhome 0.000 s\nspace Pause true\nspace Play false\nslider 0.800 s\n"
            "pose 1.200 s 1.20 s\nspeed 0.1\nplayed 1.205 s\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(ReportInBrowser, PlayingStopsAtTheEndOrRepeats) {
  const std::string dom = Browse(SampleMotion(), "t=1.48", R"(
    play(); frame(1000); frame(1050);
    say(byId('time').textContent, state.playing);
    play(); say('again from', byId('time').textContent); pause();
    byId('repeat').querySelector('button').click();
    seek(1.48); play(); frame(2000); frame(2050);
    say(byId('time').textContent, state.playing);
    pause();)");
  EXPECT_EQ(TextOf(dom, "probe"), "1.500 s false\nagain from 0.000 s\n0.000 s true\n");
}

TEST_F(ReportInBrowser, PointingAtAPlotReadsAllPlotsThereAndClickingMovesTheRobot) {
  const ReportData data = SampleMotion();
  // Half-way along the axis is 0.75 s; the pointer's event is in pixels of the window.
  const std::string dom = Browse(data, "t=0.2", R"(
    const svg = timePlots[0].svg;
    const box = svg.getBoundingClientRect();
    const at = (type) => svg.dispatchEvent(new PointerEvent(type, {
      button: 0, bubbles: true, clientX: box.left + (timePlots[0].left + timePlots[0].right) / 2, clientY: box.top + 60}));
    const values = (plot) => [...timePlots[plot].figure.querySelectorAll('output')].map((o) => o.textContent).join(' ');
    at('pointermove');
    say(timePlots[2].flag.textContent, '|', values(0), '|', values(2), '|', byId('time').textContent);
    at('pointerleave');
    say(values(0));
    at('pointerdown'); at('pointerup');
    say(byId('time').textContent);)");
  const ReportSample& hovered = data.samples[150];
  const ReportSample& shown = data.samples[40];
  const auto pair = [](const std::vector<double>& v, int digits) {
    return Fixed(v[0], digits) + " " + Fixed(v[1], digits);
  };
  EXPECT_EQ(TextOf(dom, "probe"), "0.750 s | " + pair(hovered.joint_positions_rad, 3) + " | " +
                                      pair(hovered.joint_torques_nm, 2) + " | 0.200 s\n" +
                                      pair(shown.joint_positions_rad, 3) + "\n0.750 s\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(ReportInBrowser, ViewOfTheRobotOrTheStripShowsNothingElse) {
  const std::string visible = R"(
    const seen = ['header', 'footer', '.panel', '.controls', '#stage', '#poses', '#histories', '#certificate']
      .filter((s) => document.querySelector(s).getClientRects().length > 0);
    const stageBox = byId('stage').getBoundingClientRect();
    say(seen.join(' '));
    say(stageBox.width === innerWidth && stageBox.height === innerHeight);)";
  EXPECT_EQ(TextOf(Browse(SampleMotion(), "t=0.75&view=robot", visible), "probe"),
            "#stage\ntrue\n");
  EXPECT_EQ(TextOf(Browse(SampleMotion(), "view=strip", visible), "probe"), "#poses\nfalse\n");
  EXPECT_EQ(TextOf(Browse(SampleMotion(), "", visible), "probe"),
            "header footer .panel .controls #stage #poses #histories #certificate\nfalse\n");
}

TEST_F(ReportInBrowser, FitsEveryWidthWithoutCuttingOrScrollingSideways) {
  // Elements wider than the window are scrolled or cut, so all must end inside it. Chromium's
  // window is at least 500 pixels wide; a narrower body in it, which has the same style, stands for
  // a phone.
  const std::string probe = R"(
    if (innerWidth === 500) {
      document.body.style.width = '360px';
      document.body.style.margin = '0';
      layout();
    }
    const width = document.body.getBoundingClientRect().right;
    const beyond = [...document.body.querySelectorAll('*')].filter((e) => e.id !== 'probe' && !e.closest('g, defs'))
      .filter((e) => e.getBoundingClientRect().right > width + 0.5);
    say(innerWidth, document.documentElement.scrollWidth <= innerWidth, beyond.map((e) => e.outerHTML.slice(0, 60)).join());)";
  for (const int width : {500, 600, 760, 1020, 1600}) {
    EXPECT_EQ(TextOf(Browse(SampleMotion(), "", probe, width), "probe"),
              std::to_string(width) + " true \n");
  }
}

TEST_F(ReportInBrowser, LoadsNothingAndItsOwnPolicyForbidsIt) {
  const std::string dom =
      testing::BrowsePage(WriteReport(SampleMotion(), directory_), directory_, "", R"(
    say(performance.getEntriesByType('resource').length);
    document.addEventListener('securitypolicyviolation', (event) => say(event.effectiveDirective));
    fetch('https://example.invalid/').catch(() => say('refused'));)",
                          1200, /*alone=*/true);
  EXPECT_THAT(TextOf(dom, "probe"), ::testing::AllOf(HasSubstr("0\n"), HasSubstr("connect-src")));
}

TEST_F(ReportInBrowser, ShowsHostileTextAsText) {
  ReportData data = SampleMotion();
  const std::string hostile = "</script><script>say('ran')</script><img src=x onerror=say('ran')>";
  data.title = hostile;
  data.joint_names[0] = hostile;
  data.certificate = {{hostile, hostile}};
  const std::string dom = Browse(data, "", "say(byId('title').textContent === data.title);");
  EXPECT_EQ(TextOf(dom, "probe"), "true\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(ReportInBrowser, CostsBelowZeroAreOnALinearScaleAndStraysDoNotFlattenTheRest) {
  ReportData data = SampleMotion();
  for (ReportEvaluation& evaluation : data.evaluations) evaluation.cost = -evaluation.cost;
  data.evaluations[3].cost = 1e6;
  const std::string dom = Browse(data, "", "say(solverPlots[0].spec.y[1] < 10);");
  EXPECT_THAT(dom, HasSubstr("<span class=\"name\">Cost</span>"));
  EXPECT_THAT(dom, HasSubstr(">1 above the picture</text>"));
  EXPECT_EQ(TextOf(dom, "probe"), "true\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(ReportInBrowser, ARobotWithoutJointsLimitsForcesOrSolverHasAPageToo) {
  ReportData data;
  data.title = "falling ball";
  data.duration_s = 0.2;
  data.links = {{"ball", {{{{0, 0}}, 0.1, false}}}};
  data.obstacles = {{"post", {{0, 0}}, 0.05},
                    {"bar", {{-1, 0}, {-0.5, 0}}, 0.25},
                    {"step", {{0.5, -0.25}, {0.75, -0.25}, {0.75, 0.25}, {0.5, 0.25}}, 0.125},
                    {"wedge", {{1, 0}, {2, 0}, {2, 1}}}};
  for (const double t : {0.0, 0.1, 0.2}) {
    ReportSample sample;
    sample.time_s = t;
    sample.link_poses = {{0, 1 - 4.905 * t * t, 0}};
    data.samples.push_back(sample);
  }
  const std::string dom = Browse(data, "t=0.1", R"(
    say(timePlots.map((plot) => plot.spec.title).join(', '), byId('progress').hidden, byId('certificate').hidden,
      byId('ground-window').hidden, data.obstacles.length);
    for (const o of byId('stage').querySelectorAll('.obstacle')) say(o.textContent, o.getAttribute('d'));)");
  EXPECT_EQ(TextOf(dom, "time"), "0.100 s");
  EXPECT_EQ(TextOf(dom, "probe"),
            "Root pitch, Root position true true true 4\n"
            "post M-0.05 0A0.05 0.05 0 0 1 0.05 0A0.05 0.05 0 0 1 -0.05 0z\n"
            "bar M-1 0.25A0.25 0.25 0 0 1 -1 -0.25L-0.5 -0.25A0.25 0.25 0 0 1 -0.5 0.25z\n"
            "step M0.375 -0.25A0.125 0.125 0 0 1 0.5 -0.375L0.75 -0.375"
            "A0.125 0.125 0 0 1 0.875 -0.25L0.875 0.25A0.125 0.125 0 0 1 0.75 0.375L0.5 0.375"
            "A0.125 0.125 0 0 1 0.375 0.25z\n"
            "wedge M1 0L2 0L2 1z\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
  EXPECT_THAT(dom, Not(HasSubstr("=\"NaN")));
  EXPECT_THAT(dom, Not(HasSubstr(">settling</text>")));
}

TEST_F(ReportInBrowser, AnErrorInAScriptIsShownOnThePage) {
  const std::string dom = Browse(SampleMotion(), "", "throw new Error('seen by the handler');");
  EXPECT_THAT(TextOf(dom, "errors"), HasSubstr("seen by the handler"));
}

}  // namespace
}  // namespace tumbler

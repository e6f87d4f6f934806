// The page of runs in a headless browser without a network: how its scripts show the data.

#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "offline/pages/flight_report.h"
#include "tests/offline/sample_runs.h"
#include "tests/support/browser.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::TextOf;

class FlightReportInBrowser : public ::testing::Test {
 protected:
  FlightReportInBrowser()
      : directory_(::testing::TempDir() + "tumbler runs #" +
                   ::testing::UnitTest::GetInstance()->current_test_info()->name()) {
    std::filesystem::remove_all(directory_);
  }
  ~FlightReportInBrowser() override { std::filesystem::remove_all(directory_); }

  std::string Browse(const std::vector<RunData>& runs, const std::string& fragment,
                     const std::string& probe = "", int width = 1200) {
    return testing::BrowsePage(WriteFlightReport(runs, directory_), directory_, fragment, probe,
                               width);
  }

  std::string directory_;
};

/// A second run, whose measured positions differ from those of the first.
RunData OtherRun() {
  RunData run = SampleRun();
  run.name = "records/second.rec";
  for (JointRecord& joint : run.joint_ticks) joint.measured.position_rad += 0.125F;
  return run;
}

TEST_F(FlightReportInBrowser, ReadsPlanCommandMeasurementAndTruthAtTheTimeOfItsAddress) {
  const std::string dom = Browse({SampleRun()}, "t=0.5", R"(
    say(byId('time').textContent, byId('phase').textContent);
    const [leg1] = [...byId('figures').querySelectorAll('tbody tr')];
    say([...leg1.cells].map((cell) => cell.textContent).join(' '));
    const outputs = timePlots[0].figure.querySelectorAll('output');
    say(timePlots[0].spec.title, [...outputs].map((o) => o.textContent).join(' '));
    say(timePlots[3].spec.title, timePlots[3].figure.querySelector('output').textContent);)");
  // sin(1) and 0.01, 0.02, 0.03 more; the command answered is that of the tick before, at 0.49 s:
  // sin(0.98) + 0.01.
  EXPECT_EQ(TextOf(dom, "probe"),
            "0.500 s running: handstand\nleg_1 [rad] 0.841 0.851 0.861 0.871\n"
            "Position 0.8415 0.8515 0.8615 0.8715\nFollowing error 0.02097\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(FlightReportInBrowser, DrawsTheTrueRobotInFullAndThePlanAsAnOutlineWhereTheyAre) {
  const RunData run = SampleRun();
  const std::string dom = Browse({run}, "t=0.6", R"(
    const where = (drawing) => {
      const m = stage.world.getCTM().inverse().multiply(drawing.links[0].getCTM());
      return `${m.e.toFixed(3)} ${m.f.toFixed(3)}`;
    };
    say(where(stage.robot), where(stage.others[0][1]));
    say(stage.others.length, stage.others[0][1].group.getAttribute('class'));
    const box = byId('stage').getBoundingClientRect();
    say(stage.others.every(([, d]) => d.group.getBoundingClientRect().right <= box.right));)");
  const auto& pose = run.truth[120].link_poses[0];
  const auto fixed = [](double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.3f", value);
    return std::string(text.data());
  };
  EXPECT_EQ(TextOf(dom, "probe"), fixed(pose[0]) + " " + fixed(pose[1]) + " " +
                                      fixed(pose[0] + 0.1) + " " + fixed(pose[1]) +
                                      "\n1 robot outline kind-plan run-0\ntrue\n");
}

TEST_F(FlightReportInBrowser, MarksFaultsAndRequestsWithTheirTextAndNodesAsBands) {
  const std::string dom = Browse({SampleRun()}, "", R"(
    const x = timeline.px(0.9).toFixed(2);
    say([...document.querySelectorAll('#timeline .event-fault')].some((e) =>
      e.tagName === 'line' && Number(e.getAttribute('x1')).toFixed(2) === x));
    say([...document.querySelectorAll('#timeline text.event-fault')].map((e) => e.firstChild.textContent).join('|'));
    say([...document.querySelectorAll('#timeline .band-label')].map((e) => e.textContent).join('|'));
    const band = timePlots[0].svg.querySelector('.band');
    say(Math.abs(Number(band.getAttribute('width')) - (timePlots[0].px(1.5) - timePlots[0].px(0))) < 1e-6);
    say(timePlots.every((plot) => plot.svg.querySelectorAll('line.event').length === 5));
    document.querySelectorAll('#events tbody tr')[3].click();
    say(byId('time').textContent, document.querySelectorAll('#events tbody tr').length);)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "true\nfollowing error of joint leg1: 0.4 rad, limit 0.35\nhandstand\ntrue\ntrue\n"
            "0.900 s 5\n");
}

TEST_F(FlightReportInBrowser, OfVeryManyEventsTheFaultsAreShown) {
  RunData run = SampleRun();
  for (int i = 0; i < 2000; ++i) {
    run.events.insert(run.events.begin(), {-0.2 + 1e-6 * i, RunEvent::Kind::kState, "holding"});
  }
  std::sort(run.events.begin(), run.events.end(),
            [](const RunEvent& a, const RunEvent& b) { return a.time_s < b.time_s; });
  const std::string dom = Browse({run}, "", R"(
    say(document.querySelectorAll('#events tr.event-fault').length, document.querySelectorAll('#events tbody tr').length);
    say(timePlots.every((plot) => plot.svg.querySelectorAll('line.event-fault').length === 1));
    say(byId('events-note').textContent.split(':')[0]);)");
  EXPECT_EQ(TextOf(dom, "probe"), "1 500\ntrue\n1505 more are not shown\n");
}

TEST_F(FlightReportInBrowser, WhatIsRefusedAgainAndAgainIsOneEventAndHidesNoOther) {
  const std::size_t others = SampleRun().events.size();
  RunData run = SampleRun();
  for (int i = 0; i < 900; ++i) {
    run.events.push_back({0.001 * i, RunEvent::Kind::kRefusal,
                          "leg1 is not ready: status word " + std::to_string(i)});
  }
  run.events.push_back({1.0, RunEvent::Kind::kRefusal, "leg1 is not ready: status word 7"});
  std::sort(run.events.begin(), run.events.end(),
            [](const RunEvent& a, const RunEvent& b) { return a.time_s < b.time_s; });
  const std::string dom = Browse({run}, "", R"(
    say([...document.querySelectorAll('#events tr.event-refusal')].map((r) => r.cells[3].textContent).join(' / '));
    say(document.querySelectorAll('#events tbody tr').length, timeline.svg.querySelectorAll('line.event-refusal').length);
    say(document.querySelectorAll('#timeline text.event-request').length > 0);)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "leg1 is not ready: status word 0 (900 times, until 0.899 s) / "
            "leg1 is not ready: status word 7\n" +
                std::to_string(others + 2) + " 2\ntrue\n");
}

TEST_F(FlightReportInBrowser, NamesHowTheSecondRunDiffersAndHidesWhatIsSwitchedOff) {
  const std::string dom = Browse({SampleRun(), OtherRun()}, "t=0.5", R"(
    say([...document.querySelectorAll('#differences tbody tr')][0].innerText.replace(/\s+/g, ' '));
    const seen = (selector) => [...timePlots[0].svg.querySelectorAll(selector)].filter((e) => getComputedStyle(e).display !== 'none').length;
    say(seen('path.line'), seen('path.run-1'));
    byId('runs').querySelectorAll('button')[1].click();
    say(seen('path.line'), seen('path.run-1'));
    byId('kinds').querySelector('[data-value=plan]').click();
    say(seen('path.line'), seen('path.kind-plan'));
    byId('runs').querySelectorAll('button')[1].click();
    say(seen('path.line'), byId('runs').querySelectorAll('button')[1].getAttribute('aria-pressed'));)");
  // 197 ticks have replies in both, of which those from time 0 on are compared.
  EXPECT_THAT(TextOf(dom, "probe"), ::testing::StartsWith("B leg_1 measured position 0.1250 rad "));
  EXPECT_THAT(TextOf(dom, "probe"), HasSubstr(" 180\n8 4\n4 0\n3 0\n6 true\n"));
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(FlightReportInBrowser, APrimitiveAloneIsAPlanAndNothingElse) {
  RunData plan = SampleRun();
  plan.recorded = false;
  plan.ticks.clear();
  plan.joint_ticks.clear();
  plan.truth.clear();
  plan.events.clear();
  plan.latencies.clear();
  const std::string dom = Browse({plan}, "t=0.5", R"(
    say(timePlots.map((plot) => plot.spec.title).join(', '));
    say([...new Set(timePlots.flatMap((plot) => plot.spec.curves.map((c) => c.name)))].join());
    say(['differences', 'latencies', 'events'].every((id) => byId(id).hidden), stage.others.length);)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "Position, Velocity, Torque, Position, Velocity, Torque, Root pitch, Root height, "
            "Root along x\nplan\ntrue 0\n");
  EXPECT_THAT(dom, HasSubstr("Where the robot really was is not known here."));
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(FlightReportInBrowser, TheRangeOfTimeIsThatOfTheAddressAndTheButtons) {
  const std::string dom = Browse({SampleRun()}, "t=0.5&from=0.25&to=0.75", R"(
    const span = () => say(timePlots.every((p) => p.spec.x === range), range.map((v) => v.toFixed(3)).join(' '));
    span();
    zoomBy('in'); span();
    zoomBy('out'); zoomBy('out'); span();
    zoomBy('node'); span();
    zoomBy('all'); span();
    const svg = timePlots[0].svg;
    const box = svg.getBoundingClientRect();
    setRange(0.25, 0.75);
    svg.dispatchEvent(new PointerEvent('pointerdown', {button: 0, bubbles: true,
      clientX: box.left + (timePlots[0].left + timePlots[0].right) / 2, clientY: box.top + 60}));
    say(byId('time').textContent);)");
  EXPECT_EQ(TextOf(dom, "probe"),
            "true 0.250 0.750\ntrue 0.375 0.625\ntrue 0.000 1.000\ntrue -0.050 1.550\n"
            "true -0.200 1.790\n0.500 s\n");
}

TEST_F(FlightReportInBrowser, CurvesAreInterruptedWhereThereIsNoNumber) {
  RunData run = SampleRun();
  for (std::size_t i = 40; i < 60; ++i) run.joint_ticks[2 * i].measured.position_rad = NAN;
  const std::string dom = Browse({run}, "t=0.3", R"(
    const measured = timePlots[0].svg.querySelector('path.kind-measured').getAttribute('d');
    say(measured.split('M').length - 1, timePlots[0].figure.querySelectorAll('output')[2].textContent);)");
  EXPECT_EQ(TextOf(dom, "probe"), "2 –\n");
  EXPECT_THAT(dom, Not(HasSubstr("NaN")));
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(FlightReportInBrowser, HistogramsHaveAllCountsOnLogarithmicScales) {
  const std::string dom = Browse({SampleRun()}, "", R"(
    const [bins] = [data.runs[0].latencies[0].bins];
    say(bins.reduce((sum, [, count]) => sum + count, 0));
    const table = document.querySelector('.percentiles');
    say([...table.rows[1].cells].map((cell) => cell.textContent).join('|'));
    say(latencyPlots[0].spec.curves[0].ys.every((y) => y >= Math.log10(0.5)));)");
  EXPECT_EQ(TextOf(dom, "probe"), "1001\n|1001|10 µs|14.9 µs|15 µs|2 ms\ntrue\n");
}

TEST_F(FlightReportInBrowser, ShowsHostileTextAsText) {
  const std::string hostile = "</script><script>say('ran')</script><img src=x onerror=say('ran')>";
  RunData run = SampleRun();
  run.name = hostile;
  run.scene.joint_names[0] = hostile;
  run.scene.links[0].name = hostile;
  run.facts = {{hostile, hostile}, {"motion", hostile}};
  run.bands[0].name = hostile;
  for (RunEvent& event : run.events) event.text = hostile;
  run.latencies[0].name = run.latencies[0].meaning = hostile;
  RunData other = run;
  const std::string dom = Browse({run, other}, "t=0.5", R"(
    say(byId('title').textContent.includes('<img'), document.images.length,
      document.querySelectorAll('script').length);)");
  // The error handler, the data, the page's scripts, and this probe.
  EXPECT_EQ(TextOf(dom, "probe"), "true 0 4\n");
  EXPECT_EQ(TextOf(dom, "errors"), "");
}

TEST_F(FlightReportInBrowser, FitsEveryWidthWithoutCuttingOrScrollingSideways) {
  const std::string probe = R"(
    const width = document.body.getBoundingClientRect().right;
    const beyond = [...document.body.querySelectorAll('*')].filter((e) => e.id !== 'probe' && !e.closest('svg g, defs'))
      .filter((e) => !e.closest('svg') && e.getBoundingClientRect().right > width + 0.5);
    say(innerWidth, document.documentElement.scrollWidth <= innerWidth, beyond.map((e) => e.outerHTML.slice(0, 60)).join());)";
  for (const int width : {600, 1020, 1600}) {
    EXPECT_EQ(TextOf(Browse({SampleRun(), OtherRun()}, "", probe, width), "probe"),
              std::to_string(width) + " true \n");
  }
}

TEST_F(FlightReportInBrowser, CutsOffNoButtonOnAPhone) {
  const std::string dom = Browse({SampleRun(), OtherRun()}, "", R"(
    document.body.style.width = '400px';  // the browser's own window is no narrower than 500
    const cut = [...document.querySelectorAll('button')].filter((b) => !b.hidden && b.offsetParent)
      .filter((b) => b.getBoundingClientRect().right > b.parentElement.getBoundingClientRect().right + 0.5);
    say(document.querySelectorAll('.toolbar button').length > 6, cut.map((b) => b.textContent).join());)",
                                 500);
  EXPECT_EQ(TextOf(dom, "probe"), "true \n");
}

TEST_F(FlightReportInBrowser, ThreeRunsAreAFewPagesOfPaper) {
  const std::string page = WriteFlightReport({SampleRun(), OtherRun(), OtherRun()}, directory_);
  const std::string out = directory_ + "/page.pdf";
  const std::string command =
      "'" + testing::SourcePath("scripts/screenshot") + "' '" + page + "' '' '" + out + "'";
  // NOLINTNEXTLINE(concurrency-mt-unsafe): a test of one thread.
  ASSERT_EQ(std::system(command.c_str()), 0);
  const std::size_t pages = testing::Count(testing::ReadFile(out), "/Type /Page\n");
  EXPECT_GE(pages, 2U);
  EXPECT_LE(pages, 7U);
}

TEST_F(FlightReportInBrowser, LoadsNothingAndItsOwnPolicyForbidsIt) {
  const std::string dom = Browse({SampleRun()}, "", R"(
    say(performance.getEntriesByType('resource').length);
    window.probed = new Promise((done) => document.addEventListener('securitypolicyviolation', (event) => {
      say(event.effectiveDirective);
      done();
    }));
    fetch('https://example.invalid/').catch(() => say('refused'));)");
  EXPECT_THAT(TextOf(dom, "probe"), ::testing::AllOf(HasSubstr("0\n"), HasSubstr("connect-src")));
}

}  // namespace
}  // namespace tumbler

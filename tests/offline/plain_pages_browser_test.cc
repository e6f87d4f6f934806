// The pages without scripts in a headless browser, in wide and narrow windows, light and dark.

#include <fmt/format.h>
#include <gmock/gmock-matchers.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>

#include "offline/model/planar_robot.h"
#include "offline/studies/robustness_page.h"
#include "runtime/bench/step_page.h"
#include "tests/support/browser.h"
#include "tests/support/files.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

/// A page whose drawings have everything in them: every verdict, a map, departures in two nodes.
std::string PageOfRobots() {
  Scene scene;
  scene.robot =
      ParsePlanarRobot(testing::ReadFile(testing::SourcePath("primitives/robots/tumbler.urdf")),
                       "tumbler.urdf", RootKind::kPlanarXz);
  RobustnessResult result;
  result.name = "handstand";
  constexpr std::array kOthers = {Verdict::kAmiss, Verdict::kFell, Verdict::kOverlap,
                                  Verdict::kFault, Verdict::kGotUp};
  for (std::uint64_t i = 0; i < 400; ++i) {
    TrialOutcome trial;
    trial.variation = DrawRobot(scene, {}, 1, 3, i);
    if (trial.variation.friction < 0.85) {
      trial.verdict = kOthers[i % kOthers.size()];
      trial.in = i % 3 == 0 ? "handstand" : "a_node_with_a_long_name_of_its_own";
      trial.left_s = 0.01 * static_cast<double>(i % 90);
    }
    result.trials.push_back(trial);
  }
  return RobustnessPage(result);
}

std::string PageOfSteps() {
  StepResult step;
  for (int i = 0; i <= 500; ++i) {
    step.times_s.push_back(0.001 * i);
    step.positions_rad.push_back(0.1 * (1 - std::exp(-0.01 * i) * std::cos(0.05 * i)));
  }
  return StepPage({{"drive mit 1 (leg1)", {}, step}, {"drive mit 2 (leg2)", {}, step}});
}

/// What the browser makes of a page in a window: the size in pixels of the smallest text, the least
/// contrast of a text with the paper, the paper's brightness from 0 to 1, and by how much the page
/// is wider than the window.
constexpr const char* kProbe = R"(
  var byId = (id) => document.getElementById(id);
  const luminance = (colour) => {
    const [r, g, b] = colour.match(/[\d.]+/g).slice(0, 3).map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paper = luminance(getComputedStyle(document.body).backgroundColor);
  let [size, contrast] = [Infinity, Infinity];
  for (const one of document.querySelectorAll('body *')) {
    if (['SCRIPT', 'PRE'].includes(one.tagName)) continue;
    if (![...one.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())) continue;
    const style = getComputedStyle(one);
    const scale = one.getScreenCTM ? Math.abs(one.getScreenCTM().d) : 1;
    size = Math.min(size, scale * parseFloat(style.fontSize));
    const own = luminance(one.getScreenCTM ? style.fill : style.color);
    contrast = Math.min(contrast, (Math.max(own, paper) + 0.05) / (Math.min(own, paper) + 0.05));
  }
  say(size >= 10 ? 'readable' : `text of ${size} px`);
  say(contrast >= 3 ? 'contrast' : `contrast of ${contrast}`);
  say(paper < 0.05 ? 'dark' : paper > 0.9 ? 'light' : `paper of ${paper}`);
  say(document.documentElement.scrollWidth <= innerWidth ? 'fits' : `${document.documentElement.scrollWidth} wide`);
  const map = document.querySelector('svg.map');
  const cut = map ? [...map.querySelectorAll('text')].filter((t) => t.getBoundingClientRect().left < map.getBoundingClientRect().left - 1) : [];
  say(cut.length === 0 ? 'whole' : `cut off: ${cut.map((t) => t.textContent)}`);
  document.documentElement.dataset.ready = 'true';
)";

class PlainPagesInBrowser : public ::testing::Test {
 protected:
  void ExpectReadable(const std::string& page) {
    for (const int width : {400, 1200}) {
      for (const std::string theme : {"light", "dark"}) {
        const std::string path = folder_ / "index.html";
        testing::WriteFile(path, page);
        const std::string dom =
            testing::BrowsePage(path, std::filesystem::path(path).parent_path().string(),
                                "theme=" + theme, kProbe, width);
        EXPECT_EQ(testing::TextOf(dom, "probe"), "readable\ncontrast\n" + theme + "\nfits\nwhole\n")
            << width << " px";
      }
    }
  }

  testing::TemporaryFolder folder_;
};

TEST_F(PlainPagesInBrowser, OfRobotsIsReadableInANarrowWindowAndInTheDark) {
  ExpectReadable(PageOfRobots());
}

TEST_F(PlainPagesInBrowser, OfStepsIsReadableInANarrowWindowAndInTheDark) {
  ExpectReadable(PageOfSteps());
}

}  // namespace
}  // namespace tumbler

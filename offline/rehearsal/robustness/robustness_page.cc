#include "offline/rehearsal/robustness/robustness_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "offline/rehearsal/robustness/spread_names.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

constexpr const char* kHead = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{0}</title><style>
body {{ font: 15px/1.45 system-ui, sans-serif; color: #1c2330; background: #fff; margin: 2rem auto;
  max-width: 62rem; padding: 0 1rem; }}
h1 {{ font-size: 1.5rem; margin: 0 0 .2rem; }} h2 {{ font-size: 1.1rem; margin: 1.8rem 0 .4rem; }}
p {{ margin: .3rem 0; }} table {{ border-collapse: collapse; }}
td, th {{ padding: .15rem .8rem .15rem 0; text-align: left; }} td.n {{ text-align: right; }}
.share {{ font-size: 2.2rem; font-weight: 600; }} .dim {{ color: #5d6778; }}
svg {{ max-width: 100%; height: auto; }} svg text {{ font: 12px system-ui, sans-serif; fill: #1c2330; }}
</style></head><body>
)";

std::string Escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else {
      out += c;
    }
  }
  return out;
}

const char* ColourOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStands:
      return "#2a7fb8";
    case Verdict::kAmiss:
      return "#e69f00";
    case Verdict::kFell:
      return "#b2182b";
    case Verdict::kOverlap:
      return "#7b3294";
    case Verdict::kFault:
      return "#1c2330";
    case Verdict::kGotUp:
      return "#35a06a";
    case Verdict::kNotJudged:
      return "#9aa3b2";
  }
  return "#000";
}

const char* Meaning(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStands:
      return "as asked and planned after every motion";
    case Verdict::kAmiss:
      return "completed the motions, but was not as asked after one";
    case Verdict::kFell:
      return "came to rest in another pose";
    case Verdict::kOverlap:
      return "its own shapes overlapped";
    case Verdict::kFault:
      return "the run ended in a fault";
    case Verdict::kGotUp:
      return "fell, got up, and was as asked after the last motion";
    case Verdict::kNotJudged:
      return "not looked at, and in no share";
  }
  return "";
}

std::string Verdicts(const RobustnessResult& result) {
  std::string text = "<h2>Verdicts</h2><table>\n";
  for (const Verdict verdict : kVerdicts) {
    text += fmt::format(
        "<tr><td><span style=\"color:{}\">&#9679;</span> {}</td><td class=n>{}</td><td "
        "class=dim>{}</td></tr>\n",
        ColourOf(verdict), verdict == Verdict::kStands ? "as asked" : ToString(verdict),
        result.Count(verdict), Meaning(verdict));
  }
  return text + "</table>\n";
}

/// Times at which robots left the model's way, one stroke each, a line for each node.
std::string Where(const RobustnessResult& result) {
  const std::vector<Departures> where = result.Where();
  if (where.empty() || result.study.drops) return "";
  double last_s = 0.1;
  for (const Departures& d : where) last_s = std::max(last_s, d.last_s);
  constexpr double kLeft = 260, kWidth = 570, kRow = 34;
  const double height = kRow * static_cast<double>(where.size()) + 34;
  std::string text = fmt::format(
      "<h2>Where they leave the model's way</h2>\n<p class=dim>Since the motion of the node began. "
      "A robot has left when its pitch is 0.2 rad off the model's and does not come back.</p>\n"
      "<svg viewBox=\"0 0 900 {0:.0f}\" width=\"900\" height=\"{0:.0f}\" role=\"img\">\n",
      height);
  double y = 6;
  for (const Departures& d : where) {
    text += fmt::format(
        "<text x=\"0\" y=\"{:.0f}\">{}: {} left, {} kept to it</text><line x1=\"{:.0f}\" "
        "x2=\"{:.0f}\" y1=\"{:.0f}\" y2=\"{:.0f}\" stroke=\"#c8cfda\"/>\n",
        y + 16, Escaped(d.in), d.left, d.others, kLeft + 30, kLeft + 30 + kWidth, y + 24, y + 24);
    for (const TrialOutcome& trial : result.trials) {
      if (!trial.fails() || trial.left_s < 0 || trial.in != d.in) continue;
      const double x = kLeft + 30 + kWidth * trial.left_s / last_s;
      text += fmt::format(
          "<line x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1:.0f}\" y2=\"{2:.0f}\" stroke=\"{3}\" "
          "stroke-width=\"1.6\" opacity=\"0.7\"/>",
          x, y + 4, y + 24, ColourOf(trial.verdict));
    }
    text += "\n";
    y += kRow;
  }
  for (int i = 0; i <= 4; ++i) {
    text += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{:.2f} s</text>",
                        kLeft + 30 + kWidth * i / 4, y + 14, last_s * i / 4);
  }
  return text + "</svg>\n";
}

std::string InfluenceTable(const RobustnessResult& result,
                           const std::vector<Influence>& influences) {
  if (influences.empty()) return "";
  std::string text = fmt::format(
      "<h2>What those that are not as asked have in common</h2>\n<p class=dim>Departures in "
      "{}; how much larger their mean square is than among all robots.</p>\n"
      "<table><tr><th>quantity</th><th>mean</th><th>square</th><th></th></tr>\n",
      UnitOfDepartures(result.study));
  for (const Influence& i : influences) {
    text += fmt::format(
        "<tr><td>{}</td><td class=n>{:+.2f}</td><td class=n>{:+.0f} %</td><td "
        "class=dim>{}</td></tr>\n",
        Escaped(i.name), i.mean_sigma, 100 * i.excess, i.telling() ? "" : "may be chance");
  }
  return text + "</table>\n";
}

/// White where all of a cell stand, to red where none does.
std::string Shade(const SuccessMap::Cell& cell) {
  if (cell.robots == 0) return "#f1f3f6";
  const double lost = 1 - static_cast<double>(cell.stand) / cell.robots;
  const auto mix = [lost](int to) {
    return 255 - static_cast<int>(std::lround((255 - to) * lost));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", mix(214), mix(96), mix(77));
}

std::string Map(const RobustnessResult& result, const std::vector<Influence>& influences) {
  const std::optional<SuccessMap> map = result.Map();
  if (!map) return "";
  constexpr int kCells = SuccessMap::kCells;
  constexpr double kSide = 62, kLeft = 70, kTop = 10;
  const double size = kSide * kCells;
  std::string text = fmt::format(
      "<h2>Map over the two most telling quantities</h2>\n<p class=dim>In each cell: how many of "
      "its "
      "robots are as asked. Everything else is random. The outer cells have all that is "
      "beyond.</p>\n"
      "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" role=\"img\">\n",
      size + kLeft + 10, size + kTop + 54);
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const auto& cell =
          map->cells[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
      text += fmt::format(
          "<rect x=\"{:.0f}\" y=\"{:.0f}\" width=\"{:.0f}\" height=\"{:.0f}\" fill=\"{}\" "
          "stroke=\"#fff\"/>",
          kLeft + column * kSide, kTop + (kCells - 1 - row) * kSide, kSide, kSide, Shade(cell));
    }
    text += "\n";
  }
  const double width = 2 * map->half_width / (kCells - 2);
  const auto place = [&](double sigma) {
    return std::clamp((sigma + map->half_width) / width + 1, 0.03, kCells - 0.03) * kSide;
  };
  for (const bool standing : {true, false}) {  // the others above those that stand
    for (const TrialOutcome& trial : result.trials) {
      if (!trial.judged() || trial.stands() != standing) continue;
      const auto& deviates = trial.variation.deviates;
      text +=
          fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" opacity=\"{}\"/>",
                      kLeft + place(deviates[influences[0].deviate].sigma),
                      kTop + size - place(deviates[influences[1].deviate].sigma),
                      standing ? "1.6" : "3.4", ColourOf(trial.verdict), standing ? "0.35" : "0.9");
    }
    text += "\n";
  }
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const auto& cell =
          map->cells[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
      if (cell.robots == 0) continue;
      text +=
          fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\">{}/{}</text>", kLeft + column * kSide + 4,
                      kTop + (kCells - 1 - row) * kSide + 14, cell.stand, cell.robots);
    }
  }
  for (int i = 1; i < kCells; ++i) {
    text += fmt::format(
        "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{:+.1f}</text><text x=\"{:.0f}\" "
        "y=\"{:.0f}\" text-anchor=\"end\">{:+.1f}</text>\n",
        kLeft + i * kSide, kTop + size + 16, map->EdgeOf(i), kLeft - 6,
        kTop + (kCells - i) * kSide + 4, map->EdgeOf(i));
  }
  text += fmt::format(
      "<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"middle\">{} [{}]</text><text "
      "transform=\"translate(16 {:.0f}) rotate(-90)\" text-anchor=\"middle\">{} "
      "[{}]</text>\n</svg>\n",
      kLeft + size / 2, kTop + size + 40, Escaped(map->x), UnitOfDepartures(result.study),
      kTop + size / 2, Escaped(map->y), UnitOfDepartures(result.study));
  return text;
}

std::string SpreadsText(const RobustnessResult& result) {
  std::string text;
  for (const SpreadName& spread : kSpreadNames) {
    if (spread.none(result.study.spreads)) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", spread.key,
                        spread.TextOf(result.study.spreads));
  }
  return text;
}

}  // namespace

std::string RobustnessPage(const RobustnessResult& result) {
  const Share share = result.stands();
  const std::string title = Escaped(result.name) + ": robots that are not the model";
  std::string page = fmt::format(fmt::runtime(kHead), title);
  page += fmt::format("<h1>{}</h1>\n", title);
  if (share.of == 0) {
    page += "<p class=share>not judged</p>\n";
  } else {
    page += fmt::format(
        "<p class=share>{:.1f} %</p>\n<p>{} of {} robots{} are as asked after every motion; the "
        "interval at 95 % is {:.1f} to {:.1f} %.</p>\n",
        100 * share.value(), share.count, share.of,
        share.of == static_cast<int>(result.trials.size()) ? "" : " that were judged",
        100 * share.low, 100 * share.high);
  }
  if (const std::string not_judged = NotJudgedText(result); !not_judged.empty())
    page += fmt::format("<p>{}.</p>\n", Escaped(not_judged));
  if (result.study.run.get_ups > 0 && share.of > 0) {
    const Share ends = result.ends();
    page += fmt::format(
        "<p>{} are as asked in the end, those that got up among them: {:.1f} %; the interval is "
        "{:.1f} to {:.1f} %.</p>\n",
        ends.count, 100 * ends.value(), 100 * ends.low, 100 * ends.high);
  }
  page += fmt::format(
      "<p class=dim>{}; {}spreads: {}{}; seed {}{}{}</p>\n", Escaped(result.study.motion),
      result.study.lanes ? "played in lanes; " : "played in the twin; ", SpreadsText(result),
      result.study.scale == 1 ? "" : fmt::format(", times {:.6g}", result.study.scale),
      result.study.seed,
      result.study.run.cycles > 0 ? fmt::format("; {} cycles", result.study.run.cycles) : "",
      DisturbancesOf(result.study));
  const std::vector<Influence> influences = result.Influences();
  page += Verdicts(result) + Where(result) + InfluenceTable(result, influences) +
          Map(result, influences);
  return page + "</body></html>\n";
}

}  // namespace tumbler

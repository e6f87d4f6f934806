#include "offline/studies/robustness_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "common/files/markup.h"
#include "offline/studies/plain_page.h"
#include "offline/studies/spread_names.h"

namespace tumbler {
namespace {

using Verdict = TrialOutcome::Verdict;

// Drawings are as wide as the window: what is drawn has its place across in per cent and its size
// in pixels, so that texts stay readable in a narrow one.
constexpr const char* kByDay =
    "--lost: #d6604d; --stands: #2a7fb8; --amiss: #b97a00; --fell: #b2182b; --overlap: #7b3294; "
    "--fault: #1c2330; --got-up: #268453; --not-judged: #6b7485;";
constexpr const char* kByNight =
    "--lost: #8f3022; --stands: #5aa9ee; --amiss: #e6a83a; --fell: #ff7b6e; --overlap: #c785d8; "
    "--fault: #e8e9ea; --got-up: #35c496; --not-judged: #9aa3b2;";
constexpr const char* kStyle =
    R"(td.name { min-width: 6em; overflow-wrap: anywhere; } td.verdict { white-space: nowrap; }
.share { font-size: 2.2rem; font-weight: 600; }
.stands { color: var(--stands); } .amiss { color: var(--amiss); } .fell { color: var(--fell); }
.overlap { color: var(--overlap); } .fault { color: var(--fault); } .got-up { color: var(--got-up); } .not-judged { color: var(--not-judged); }
svg text { font: 12px system-ui, sans-serif; fill: var(--ink); }
svg line { stroke: currentColor; stroke-width: 1.6px; opacity: 0.7; }
svg line.axis { stroke: var(--line); opacity: 1; }
svg circle { fill: currentColor; }
svg rect { stroke: var(--paper); fill: var(--empty); } svg rect.lost { fill: var(--lost); }
.map { max-width: 640px; } .map .cell { font-size: 11px; }
@media (max-width: 560px) { .map .cell { font-size: 10px; } .map circle { r: 2px; } })";

/// The class of what is drawn of a robot, which gives its colour.
const char* ClassOf(Verdict verdict) {
  switch (verdict) {
    case Verdict::kStands:
      return "stands";
    case Verdict::kAmiss:
      return "amiss";
    case Verdict::kFell:
      return "fell";
    case Verdict::kOverlap:
      return "overlap";
    case Verdict::kFault:
      return "fault";
    case Verdict::kGotUp:
      return "got-up";
    case Verdict::kNotJudged:
      return "not-judged";
  }
  return "";
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
        "<tr><td class=verdict><span class={}>&#9679;</span> {}</td><td class=n>{}</td><td "
        "class=dim>{}</td></tr>\n",
        ClassOf(verdict), verdict == Verdict::kStands ? "as asked" : ToString(verdict),
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
  constexpr double kLeft = 2, kWidth = 94, kRow = 46;  // per cent, per cent, pixels
  const double height = kRow * static_cast<double>(where.size()) + 22;
  std::string text = fmt::format(
      "<h2>Where they leave the model's way</h2>\n<p class=dim>Since the motion of the node began. "
      "A robot has left when its pitch is 0.2 rad off the model's and does not come back.</p>\n"
      "<svg class=where height=\"{:.0f}\" role=\"img\">\n",
      height);
  double y = 0;
  for (const Departures& d : where) {
    text += fmt::format(
        "<text x=\"0\" y=\"{:.0f}\">{}: {} left, {} kept to it</text><line class=axis "
        "x1=\"{:.0f}%\" x2=\"{:.0f}%\" y1=\"{:.0f}\" y2=\"{:.0f}\"/>\n",
        y + 14, MarkupText(d.in), d.left, d.others, kLeft, kLeft + kWidth, y + 40, y + 40);
    for (const TrialOutcome& trial : result.trials) {
      if (!trial.fails() || trial.left_s < 0 || trial.in != d.in) continue;
      const double x = kLeft + kWidth * trial.left_s / last_s;
      text += fmt::format(
          "<line class={3} x1=\"{0:.2f}%\" x2=\"{0:.2f}%\" y1=\"{1:.0f}\" y2=\"{2:.0f}\"/>", x,
          y + 20, y + 40, ClassOf(trial.verdict));
    }
    text += "\n";
    y += kRow;
  }
  for (int i = 0; i <= 4; ++i) {
    text += fmt::format("<text x=\"{:.1f}%\" y=\"{:.0f}\" text-anchor=\"{}\">{:.2f} s</text>",
                        kLeft + kWidth * i / 4, y + 10,
                        i == 0   ? "start"
                        : i == 4 ? "end"
                                 : "middle",
                        last_s * i / 4);
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
        "<tr><td class=name>{}</td><td class=n>{:+.2f}</td><td class=n>{:+.0f} %</td><td "
        "class=dim>{}</td></tr>\n",
        MarkupText(i.name), i.mean_sigma, 100 * i.excess, i.telling() ? "" : "may be chance");
  }
  return text + "</table>\n";
}

std::string Map(const RobustnessResult& result, const std::vector<Influence>& influences) {
  const std::optional<SuccessMap> map = result.Map();
  if (!map) return "";
  constexpr int kCells = SuccessMap::kCells;
  constexpr double kColumn = 9.4, kLeft = 13, kRow = 58, kTop = 10;  // per cent and pixels
  const double bottom = kTop + kRow * kCells;
  const auto cell_at = [&map](int row, int column) -> const SuccessMap::Cell& {
    return map->cells[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
  };
  std::string text = fmt::format(
      "<h2>Map over the two most telling quantities</h2>\n<p class=dim>In each cell: how many of "
      "its "
      "robots are as asked. Everything else is random. The outer cells have all that is "
      "beyond.</p>\n"
      "<p class=dim>Up: {} [{}]</p>\n<svg class=map height=\"{:.0f}\" role=\"img\">\n",
      MarkupText(map->y), UnitOfDepartures(result.study), bottom + 54);
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const SuccessMap::Cell& cell = cell_at(row, column);
      // The more of a cell's robots are lost, the more of the colour covers the paper.
      const double lost = cell.robots == 0 ? 0 : 1 - static_cast<double>(cell.stand) / cell.robots;
      text +=
          fmt::format("<rect x=\"{:.2f}%\" y=\"{:.0f}\" width=\"{:.2f}%\" height=\"{:.0f}\"{}/>",
                      kLeft + column * kColumn, kTop + (kCells - 1 - row) * kRow, kColumn, kRow,
                      cell.robots == 0 ? std::string()
                                       : fmt::format(" class=lost fill-opacity=\"{:.2f}\"", lost));
    }
    text += "\n";
  }
  const double width = 2 * map->half_width / (kCells - 2);
  const auto place = [&](double sigma) {
    return std::clamp((sigma + map->half_width) / width + 1, 0.03, kCells - 0.03);
  };
  for (const bool standing : {true, false}) {  // the others above those that stand
    for (const TrialOutcome& trial : result.trials) {
      if (!trial.judged() || trial.stands() != standing) continue;
      const auto& deviates = trial.variation.deviates;
      text += fmt::format("<circle class={} cx=\"{:.2f}%\" cy=\"{:.1f}\" r=\"{}\" opacity=\"{}\"/>",
                          ClassOf(trial.verdict),
                          kLeft + kColumn * place(deviates[influences[0].deviate].sigma),
                          bottom - kRow * place(deviates[influences[1].deviate].sigma),
                          standing ? "1.6" : "3.4", standing ? "0.35" : "0.9");
    }
    text += "\n";
  }
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const SuccessMap::Cell& cell = cell_at(row, column);
      if (cell.robots == 0) continue;
      const double y = kTop + (kCells - 1 - row) * kRow;
      // One below the other: a cell of a narrow window has no room for both in a line.
      text += fmt::format(
          "<text class=cell x=\"{0:.2f}%\" y=\"{1:.0f}\">{2}</text><text class=cell "
          "x=\"{0:.2f}%\" y=\"{3:.0f}\">/{4}</text>\n",
          kLeft + column * kColumn + 0.6, y + 14, cell.stand, y + 27, cell.robots);
    }
  }
  for (int i = 1; i < kCells; ++i) {
    text += fmt::format(
        "<text x=\"{:.2f}%\" y=\"{:.0f}\" text-anchor=\"middle\">{:+.1f}</text><text x=\"{:.2f}%\" "
        "y=\"{:.0f}\" text-anchor=\"end\">{:+.1f}</text>\n",
        kLeft + i * kColumn, bottom + 16, map->EdgeOf(i), kLeft - 1, kTop + (kCells - i) * kRow + 4,
        map->EdgeOf(i));
  }
  text += fmt::format(
      "<text x=\"{:.2f}%\" y=\"{:.0f}\" text-anchor=\"middle\">{} [{}]</text>\n</svg>\n",
      kLeft + kColumn * kCells / 2, bottom + 40, MarkupText(map->x),
      UnitOfDepartures(result.study));
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
  const std::string title = result.name + ": robots that are not the model";
  std::string page = PlainPageHead(title, kByDay, kByNight, kStyle);
  page += fmt::format("<h1>{}</h1>\n", MarkupText(title));
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
    page += fmt::format("<p>{}.</p>\n", MarkupText(not_judged));
  if (result.study.run.get_ups > 0 && share.of > 0) {
    const Share ends = result.ends();
    page += fmt::format(
        "<p>{} are as asked in the end, those that got up among them: {:.1f} %; the interval is "
        "{:.1f} to {:.1f} %.</p>\n",
        ends.count, 100 * ends.value(), 100 * ends.low, 100 * ends.high);
  }
  page += fmt::format(
      "<p class=dim>{}; {}spreads: {}{}; seed {}{}{}</p>\n", MarkupText(result.study.motion),
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

#include "offline/studies/certify.h"

#include <fmt/format.h>

#include <algorithm>
#include <list>
#include <set>

#include "common/files/primitive_hash.h"
#include "common/files/printable.h"
#include "common/files/program.h"
#include "common/files/result_file.h"
#include "common/files/sequence_toml.h"
#include "common/files/toml_reader.h"
#include "offline/studies/checkpoint.h"
#include "offline/studies/spread_names.h"

namespace tumbler {

std::string TextOf(const Spreads& spreads) {
  std::string text;
  for (const SpreadName& spread : kSpreadNames) {
    if (spread.none(spreads)) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : " ", spread.option, spread.TextOf(spreads));
  }
  return text.empty() ? "none" : text;
}

namespace {

/// Whether two figures answer the same question.
bool SameQuestion(const RobustnessFigure& a, const RobustnessFigure& b) {
  return a.motion == b.motion && a.cycles == b.cycles && a.scale == b.scale &&
         a.spreads == b.spreads && a.hold_s == b.hold_s && a.where == b.where &&
         a.drives_file == b.drives_file;
}

/// The hashes of the primitives that a study plays: of the nodes to which the start leads without a
/// branch. A robot that stands begins with the start.
std::vector<std::string> HashesOfPlayed(const SequenceFile& motion) {
  std::set<int> reached;
  std::vector<int> nodes = {motion.graph.start};
  std::vector<std::string> hashes;
  while (!nodes.empty()) {
    const int node = nodes.back();
    nodes.pop_back();
    if (!reached.insert(node).second) continue;
    hashes.push_back(ContentHash(motion.PrimitiveOf(node)));
    for (const SequenceEdge<double>& edge : motion.graph.edges()) {
      if (edge.from == node && edge.when != EdgeCondition::kBranch) nodes.push_back(edge.to);
    }
  }
  return hashes;
}

}  // namespace

RobustnessFigure FigureOf(const RobustnessResult& result) {
  const RobustnessStudy& study = result.study;
  const Share share = result.stands();
  RobustnessFigure figure;
  figure.motion = result.name;
  figure.cycles = study.run.cycles;
  figure.stand = share.count;
  figure.robots = share.of;
  figure.share_95_low = share.low;
  figure.share_95_high = share.high;
  figure.seed = study.seed;
  figure.scale = study.scale;
  figure.spreads = TextOf(study.spreads);
  figure.hold_s = study.run.hold_s;
  if (study.lanes) figure.where = RobustnessFigure::Where::kLanes;
  figure.drives_file = PrintableInLine(study.drives);
  if (!study.drives.empty()) figure.drives_hash = HashOfText(ReadTextFile(study.drives));
  return figure;
}

void PutFigure(const RobustnessFigure& figure, std::vector<RobustnessFigure>& figures) {
  const auto same = std::find_if(figures.begin(), figures.end(), [&](const RobustnessFigure& old) {
    return SameQuestion(old, figure);
  });
  if (same == figures.end()) {
    figures.push_back(figure);
  } else {
    *same = figure;
  }
}

std::vector<std::string> Certify(const RobustnessResult& result) {
  if (HashOfFiles(result.study) != result.files) {
    throw Refused(
        fmt::format("{}: a file of it was changed while robots played it, so that their "
                    "share is not that of what is there now; nothing was written, start "
                    "again",
                    result.study.motion));
  }
  if (const std::string not_judged = NotJudgedText(result); !not_judged.empty())
    throw Refused(fmt::format("{}: {}; nothing was written", result.study.motion, not_judged));
  const RobustnessFigure figure = FigureOf(result);
  std::vector<std::string> inputs, written;
  const SequenceFile motion = LoadMotion(result.study.motion, NotingReader(inputs));
  const std::vector<std::string> played = HashesOfPlayed(motion);
  // The sequence itself has no certificate.
  if (inputs.back() != result.study.motion) std::erase(inputs, result.study.motion);
  std::list<PendingFile> files;
  for (const std::string& path : inputs) {
    PrimitiveFile file = LoadPrimitive(path);
    if (std::ranges::find(played, ContentHash(file)) == played.end()) continue;
    PutFigure(figure, file.robustness);
    files.emplace_back(path, ToToml(file));
    written.push_back(path);
  }
  for (PendingFile& file : files) file.Commit();
  return written;
}

}  // namespace tumbler

#include "offline/certify/chain.h"

namespace tumbler {

const char* ToString(Posture posture) {
  switch (posture) {
    case Posture::kUpright:
      return "upright";
    case Posture::kLevel:
      return "level";
    case Posture::kInclined:
      return "inclined";
    case Posture::kHanging:
      return "hanging";
    case Posture::kAbove:
      return "above";
    case Posture::kFixed:
      return "fixed";
  }
  return "unknown";
}

const char* ToString(ChainFailure::Cause cause) {
  switch (cause) {
    case ChainFailure::Cause::kImplausible:
      return "implausible";
    case ChainFailure::Cause::kCore:
      return "core";
    case ChainFailure::Cause::kTouch:
      return "touch";
    case ChainFailure::Cause::kOverlap:
      return "overlap";
    case ChainFailure::Cause::kStop:
      return "stop";
    case ChainFailure::Cause::kFallen:
      return "fallen";
    case ChainFailure::Cause::kExit:
      return "exit";
    case ChainFailure::Cause::kPurpose:
      return "purpose";
    case ChainFailure::Cause::kEntry:
      return "entry";
  }
  return "unknown";
}

ChainOutcome::Judged ChainOutcome::CountJudged() const {
  Judged count;
  for (const PlayedNode& passage : passages) {
    for (const JudgedTarget& judged : passage.purpose)
      ++(judged.result ? count.judged : count.not_judged);
  }
  return count;
}

}  // namespace tumbler

#pragma once

#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/studies/study.h"

namespace tumbler {

/// Spreads as a primitive's file has them: options with their values, without those that are 0.
std::string TextOf(const Spreads& spreads);

/// The figure of a study, as a primitive's file has it. @throws FileError  when the drives file
/// cannot be read.
RobustnessFigure FigureOf(const RobustnessResult& result);

/// Puts a figure among those of a primitive. It takes the place of one with the same question: of
/// the same motion, robots and drives, however many were played.
void PutFigure(const RobustnessFigure& figure, std::vector<RobustnessFigure>& figures);

/// Writes the figure of a study into the motion's primitive, or into each primitive of the sequence
/// that it plays: not those of branches and of beginnings of robots that lie. All are ready before
/// the first is replaced. @returns their paths.
/// @throws FileError  when a file cannot be read or written.
/// @throws Refused    when a file of the study was changed since it began, or robots were not
///                    judged.
/// @pre the study has no twin file: a figure has no place for it.
std::vector<std::string> Certify(const RobustnessResult& result);

}  // namespace tumbler

#pragma once

#include <span>
#include <string>
#include <vector>

#include "common/files/primitive_toml.h"
#include "offline/problem/problem.h"
#include "offline/problem/task_toml.h"

namespace tumbler {

/// A path with other control points, and stretched to another duration: that of the clamped uniform
/// spline which is nearest to it.
///
/// Where the new knots contain the old ones and the degree is the same, the knots are inserted
/// [Cohen, Lyche, Riesenfeld 1980], and the new spline is the same path to rounding. This is so
/// from n control points to n + k (n - degree): 12, 19, 26 ... for degree 5. Otherwise the squares
/// of the differences at even times are least, with the first and the last three points as the ends
/// at rest need them.
/// @param control_points  7 or more, and more than `degree`.
JointMotion<double>::Spline Resampled(const JointMotion<double>::Spline& path, int degree,
                                      int control_points, double duration_s);

/// The parameters of `problem` for the motion that x is in another problem with the same joints,
/// degree, ends and duration, and other control points.
std::vector<double> WithControlPointsOf(const Problem& problem, const Problem& other,
                                        std::span<const double> x);

/// The parameters of the problem whose paths are those of a primitive: of another task, robot,
/// ground, duration or number of control points. Joints are matched by their names. Where the
/// problem starts or ends elsewhere, the difference fades in or out smoothly along the path. Where
/// the duration is free, it is the primitive's, as far as its bounds allow.
/// @param file_name  of the primitive, for messages.
/// @throws FileError  when the primitive lacks a joint of the problem.
std::vector<double> GuessFrom(const Problem& problem, const PrimitiveFile& file,
                              const std::string& file_name);

/// Lets a task be solved from there, and say so. Where the duration is free in a search for robots
/// that differ, the problem's becomes the primitive's, as far as its bounds allow. Where the task
/// has a [mirror], the guess is the primitive's mirror image, and where it takes the gains of the
/// guess, those are taken. The same parameters and errors; and when there are no such gains.
void TakeGuess(Task& task, const PrimitiveFile& file, const std::string& file_name);

/// Lets a task be solved for robots that a motion does not carry: one that is tried before, from
/// the same pose and through the same drives. May be called for several; a robot counts that none
/// of them carries.
/// @param file_name  of the primitive, for messages.
/// @throws FileError  when the task is not solved for robots that differ, or has a feedback of its
///                    own; when the primitive has one, lacks a joint of the task, starts elsewhere,
///                    or was found for other drives.
void TakeComplement(Task& task, const PrimitiveFile& file, const std::string& file_name);

/// @throws FileError  where a task that says what to take of a guess has none.
void CheckGuess(const Task& task);

/// The parameters of a primitive's own task at its paths: the control points that are free.
/// @pre the joints' paths are all that the task leaves free.
std::vector<double> ParametersOf(const Primitive<double>& primitive);

}  // namespace tumbler

#include "offline/solve/guess.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>

#include "common/core/index.h"
#include "common/files/toml_reader.h"
#include "offline/model/least_squares.h"
#include "offline/problem/link_chains.h"
#include "offline/problem/start_toml.h"
#include "offline/solve/free_paths.h"
#include "offline/solve/rollout.h"

namespace tumbler {
namespace {

using Path = JointMotion<double>::Spline;

/// Knots nearer than this part of the duration are one.
constexpr double kSameKnot = 1e-9;

/// The old knots in the new time, those that are also new ones exactly so. None when one of them is
/// no new knot.
std::optional<std::vector<double>> KnotsAmong(const Path& path, std::span<const double> knots,
                                              double duration_s) {
  const double scale = duration_s / (path.end_s() - path.start_s());
  std::vector<double> found;
  for (const double knot : path.knots()) {
    const double time = (knot - path.start_s()) * scale;
    const auto near = std::ranges::find_if(
        knots, [&](double other) { return std::abs(other - time) <= kSameKnot * duration_s; });
    if (near == knots.end()) return std::nullopt;
    found.push_back(*near);
  }
  return found;
}

/// The control points over the new knots, by the Oslo algorithm: point i is the polar form of the
/// old polynomial around new knot i, at the new knots i + 1 ... i + degree.
/// @param old_knots  of the path, all of them among the new ones.
std::vector<double> InsertKnots(const Path& path, std::span<const double> old_knots,
                                std::span<const double> knots) {
  const int p = path.degree();
  const int n = static_cast<int>(knots.size()) - p - 1;
  std::vector<double> points;
  for (int i = 0; i < n; ++i) {
    const auto after = std::upper_bound(old_knots.begin(), old_knots.end(), knots[Index(i)]);
    const int span = static_cast<int>(after - old_knots.begin()) - 1;
    std::vector<double> d(path.control_points().begin() + span - p,
                          path.control_points().begin() + span + 1);
    for (int r = 1; r <= p; ++r) {
      const double t = knots[Index(i + r)];
      for (int k = p; k >= r; --k) {
        const double low = old_knots[Index(span - p + k)];
        const double high = old_knots[Index(span + k - r + 1)];
        const double share = (t - low) / (high - low);
        d[Index(k)] = (1 - share) * d[Index(k - 1)] + share * d[Index(k)];
      }
    }
    points.push_back(d.back());
  }
  return points;
}

/// Makes the free points of `nearest` those with the least squares of its differences to a path.
void Fit(const Path& path, Path& nearest) {
  const auto knots = nearest.knots();
  std::vector<double> points(nearest.control_points().begin(), nearest.control_points().end());
  const int free = static_cast<int>(points.size()) - 6;
  constexpr int kSamplesPerPoint = 16;
  const int samples =
      kSamplesPerPoint * static_cast<int>(std::max(points.size(), path.control_points().size()));
  const double scale = (path.end_s() - path.start_s()) / nearest.end_s();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(samples, free);
  Eigen::VectorXd b(samples);
  for (int k = 0; k < samples; ++k) {
    const double t = nearest.end_s() * (k + 0.5) / samples;
    b[k] = path.Evaluate(path.start_s() + scale * t).value;
    const Path::Weights w = nearest.EvaluateWeights(t);
    for (int i = 0; i <= nearest.degree(); ++i) {
      const int point = w.first + i;
      if (point >= 3 && point < 3 + free) {
        A(k, point - 3) = w.w[0][Index(i)];
      } else {
        b[k] -= w.w[0][Index(i)] * points[Index(point)];
      }
    }
  }
  const Eigen::VectorXd fit = SolveLeastSquares(A, b);
  std::copy(fit.begin(), fit.end(), points.begin() + 3);
  if (nearest.Assign(nearest.degree(), std::vector<double>(knots.begin(), knots.end()), points) !=
      Status::kOk)
    throw std::logic_error("the fit of a path is not a spline");
}

/// 0 at 0 and 1 at 1, with no first and second derivative there.
double Fade(double s) { return s * s * s * (10 - s * (15 - 6 * s)); }

const std::string& NameOf(const Problem& problem, std::size_t joint) {
  return problem.joint_name(joint);
}

/// Which of a primitive's joints is that of the problem.
/// @param use  what the primitive is for.
std::size_t JointIn(const PrimitiveFile& file, const std::string& file_name, const Problem& problem,
                    std::size_t joint, const char* use = "a guess") {
  const std::span<const JointMotion<double>> motions = file.primitive.motions();
  const std::string& name = NameOf(problem, joint);
  const auto found = std::ranges::find_if(
      motions, [&](const JointMotion<double>& motion) { return motion.name.view() == name; });
  if (found == motions.end()) {
    throw FileError(
        file_name, 0, "joint",
        fmt::format("has no joint '{}', which the task moves; {} needs a path for every "
                    "joint of the task",
                    name, use));
  }
  return static_cast<std::size_t>(found - motions.begin());
}

/// The mirror image of a motion: the robot turned about the vertical, so that what turned it to one
/// side turns it to the other. A joint moves as its partner did, the other way round. The entry is
/// mirrored, too; all else stays as it was, and belongs to the motion before.
PrimitiveFile Mirrored(const PrimitiveFile& file, const std::string& file_name,
                       const Problem& problem) {
  PrimitiveFile mirrored = file;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const std::size_t to = JointIn(file, file_name, problem, j);
    const std::size_t from = JointIn(file, file_name, problem, problem.guess_mirror[j]);
    const Path& path = file.primitive.joints[from].position;
    std::vector<double> points(path.control_points().begin(), path.control_points().end());
    for (double& point : points) point = -point;
    if (mirrored.primitive.joints[to].position.Assign(path.degree(), path.knots(), points) !=
        Status::kOk)
      throw std::logic_error("the mirror image of a spline is none");
    // An error to the other side is answered to the other side, by the partner.
    mirrored.primitive.feedback.joints[to] = file.primitive.feedback.joints[from];
  }
  mirrored.entry.root_x_m_s = -file.entry.root_x_m_s;
  mirrored.entry.root_pitch_rad_s = -file.entry.root_pitch_rad_s;
  return mirrored;
}

/// @throws FileError  when a guess cannot be taken as it is.
/// @param x  the parameters of its paths.
void CheckSamePath(const Problem& problem, std::span<const double> x, const PrimitiveFile& file,
                   const std::string& file_name) {
  constexpr double kSame_rad = 1e-9;  // A file's digits are finer.
  constexpr int kTimes = 1000;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const Path path = PositionSpline(problem, x, j);
    const Path& given = file.primitive.joints[JointIn(file, file_name, problem, j)].position;
    double most_rad = 0;
    for (int k = 0; k <= kTimes; ++k) {
      const double s = static_cast<double>(k) / kTimes;
      most_rad = std::max(most_rad, std::abs(path.Evaluate(s * problem.duration_s).value -
                                             given.Evaluate(s * given.end_s()).value));
    }
    if (most_rad <= kSame_rad) continue;
    throw FileError(
        file_name, 0, "joint",
        fmt::format(
            "'{}' has a path that the task's differs from by {:.2g} rad; its gains "
            "(robust.feedback.from_guess) are for its own path: give the task the [spline], "
            "[start], [end] and [tied] of that motion",
            NameOf(problem, j), most_rad));
  }
}

/// The feedback of a guess whose gains the task takes: with the joints in the problem's order.
/// @throws FileError  when there is none, or it is of another link or duration.
std::optional<Feedback<double>> TakenFeedback(const Problem& problem, std::span<const double> x,
                                              const PrimitiveFile& file,
                                              const std::string& file_name) {
  const auto& robust = problem.robust;
  if (!robust || !robust->feedback || !robust->feedback->from_guess) return std::nullopt;
  const Feedback<double>& feedback = file.primitive.feedback;
  if (!feedback.present()) {
    throw FileError(file_name, 0, "feedback",
                    "is missing, and the task takes its gains (robust.feedback.from_guess); give a "
                    "guess with feedback, or leave that out");
  }
  if (std::abs(file.primitive.duration_s - problem.duration_s) > kSameKnot * problem.duration_s) {
    throw FileError(file_name, 0, "duration_s",
                    fmt::format("is {}, and the task's {}; its gains (robust.feedback.from_guess) "
                                "are for that time: give both the same",
                                file.primitive.duration_s, problem.duration_s));
  }
  const LaneDrive& through = robust->drive;
  if (file.drives && *file.drives != DriveGains{through.kp, through.kd}) {
    throw FileError(
        file_name, 0, "drives",
        fmt::format("are {:.6g} N m/rad and {:.6g} N m s/rad, and the task's kp_nm_per_rad and "
                    "kd_nm_s_per_rad in [robust] {:.6g} and {:.6g}; its gains "
                    "(robust.feedback.from_guess) are for those drives: give both the same",
                    file.drives->kp_nm_per_rad, file.drives->kd_nm_s_per_rad, through.kp,
                    through.kd));
  }
  CheckSamePath(problem, x, file, file_name);
  Feedback<double> ordered = feedback;
  const std::vector<LinkChain> chains = LinkChainsOf(problem.scene.robot);
  const auto chain = std::ranges::find(chains, robust->feedback->link, &LinkChain::link);
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    ordered.joints[j] = feedback.joints[JointIn(file, file_name, problem, j)];
    if (chain == chains.end() || ordered.joints[j].chain != chain->joints[j]) {
      throw FileError(file_name, 0, "feedback.link",
                      fmt::format("is '{}'{}, and the task's robust.feedback.link '{}'; its gains "
                                  "(robust.feedback.from_guess) are for that link alone",
                                  feedback.link.view(),
                                  problem.guess_mirror.empty()
                                      ? ""
                                      : ", which in the mirror image is its partner ([mirror])",
                                  robust->feedback->link));
    }
  }
  return ordered;
}

}  // namespace

Path Resampled(const Path& path, int degree, int control_points, double duration_s) {
  std::vector<double> knots(Index(control_points + degree + 1));
  std::vector<double> points(Index(control_points), path.control_points().back());
  std::fill_n(points.begin(), 3, path.control_points().front());
  if (control_points < 7 ||
      Path::ClampedUniformKnots(degree, control_points, duration_s, knots) != Status::kOk)
    throw std::invalid_argument("a path cannot have these control points, degree and duration");
  Path result;
  std::optional<std::vector<double>> old_knots;
  if (path.degree() == degree) old_knots = KnotsAmong(path, knots, duration_s);
  if (old_knots) points = InsertKnots(path, *old_knots, knots);
  if (result.Assign(degree, knots, points) != Status::kOk)
    throw std::invalid_argument("a path cannot have these control points, degree and duration");
  if (!old_knots) Fit(path, result);
  return result;
}

std::vector<double> WithControlPointsOf(const Problem& problem, const Problem& other,
                                        std::span<const double> x) {
  std::vector<double> result;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const Path path = Resampled(PositionSpline(other, x, j), problem.degree,
                                problem.joints[j].control_points, problem.duration_s);
    const auto points = path.control_points();
    result.insert(result.end(), points.begin() + 3, points.end() - 3);
  }
  // Velocities at the start and the duration, where they are free.
  const std::span<const double> others = x.subspan(Index(other.first_start_rate()));
  result.insert(result.end(), others.begin(), others.end());
  return result;
}

std::vector<double> GuessFrom(const Problem& problem, const PrimitiveFile& file,
                              const std::string& file_name) {
  std::vector<double> guess;
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    const ActuatedJoint& joint = problem.joints[j];
    const JointMotion<double>& motion = file.primitive.joints[JointIn(file, file_name, problem, j)];
    const Path path =
        Resampled(motion.position, problem.degree, joint.control_points, problem.duration_s);
    const auto points = path.control_points();
    const double at_start = joint.start_rad - points.front();
    const double at_end = joint.end_rad - points.back();
    for (int i = 3; i < joint.control_points - 3; ++i) {
      double abscissa = 0;  // of Greville
      for (int k = 1; k <= problem.degree; ++k) abscissa += path.knots()[Index(i + k)];
      const double share = Fade(abscissa / (problem.degree * problem.duration_s));
      guess.push_back(points[Index(i)] + (1 - share) * at_start + share * at_end);
    }
  }
  const std::array at_start = {file.entry.root_x_m_s, file.entry.root_z_m_s,
                               file.entry.root_pitch_rad_s};
  for (const std::size_t coordinate : problem.free_start_coordinates()) {
    const auto& [least, most] = *problem.free_start_rates[coordinate];
    guess.push_back(std::clamp(at_start[coordinate], least, most));
  }
  if (problem.free_duration) {
    const Interval<double> bounds = problem.bounds_of_parameter(static_cast<int>(guess.size()));
    guess.push_back(
        std::clamp(file.primitive.duration_s / problem.duration_s, bounds.min, bounds.max));
  }
  return FreePaths(problem).Tied(std::move(guess));
}

void TakeGuess(Task& task, const PrimitiveFile& file, const std::string& file_name) {
  // A search for robots that differ begins with the duration of the problem.
  if (const auto& robust = task.problem.robust; robust && robust->duration_max_s) {
    task.problem.duration_s =
        std::clamp(file.primitive.duration_s, *robust->duration_min_s, *robust->duration_max_s);
  }
  const Problem& problem = task.problem;
  const PrimitiveFile guess =
      problem.guess_mirror.empty() ? file : Mirrored(file, file_name, problem);
  task.guess = GuessFrom(problem, guess, file_name);
  task.guess_feedback = TakenFeedback(problem, task.guess, guess, file_name);
  task.guess_file = file_name;
  task.guess_hash = ContentHash(file);
}

void TakeComplement(Task& task, const PrimitiveFile& file, const std::string& file_name) {
  const Problem& problem = task.problem;
  if (!problem.robust || problem.robust->feedback) {
    throw FileError(
        task.task_file, 0, problem.robust ? "robust.feedback" : "robust",
        fmt::format("is {}; --complement is for a motion that is found for robots that differ, "
                    "without a feedback: {}",
                    problem.robust ? "here" : "missing",
                    problem.robust ? "leave it out" : "give the task a [robust]"));
  }
  if (file.primitive.feedback.present()) {
    throw FileError(file_name, 0, "feedback",
                    "corrects the motion, and --complement plays it as it was planned; give one "
                    "without");
  }
  const LaneDrive& through = problem.robust->drive;
  if (file.drives && *file.drives != DriveGains{through.kp, through.kd}) {
    throw FileError(file_name, 0, "drives",
                    fmt::format("are {:.6g} N m/rad and {:.6g} N m s/rad, and the task's "
                                "kp_nm_per_rad and kd_nm_s_per_rad in [robust] {:.6g} and {:.6g}; "
                                "a robot that tries one after the other has the same for both",
                                file.drives->kp_nm_per_rad, file.drives->kd_nm_s_per_rad,
                                through.kp, through.kd));
  }
  const double pitch_rad = problem.start_q[kPitchOfRoot];
  if (std::abs(file.entry.root_pitch_rad - pitch_rad) > kStartPitchTolerance) {
    throw FileError(
        file_name, 0, "entry.root_pitch_rad",
        fmt::format("is {:.6g}, and the task's pitch {:.6g} rad; allowed: the same pose "
                    "of the root to within {:.6g}, as one is tried after the other",
                    file.entry.root_pitch_rad, pitch_rad, kStartPitchTolerance));
  }
  Primitive<double> motion = file.primitive;
  motion.joint_count = static_cast<int>(problem.joints.size());
  for (std::size_t j = 0; j < problem.joints.size(); ++j) {
    motion.joints[j] =
        file.primitive.joints[JointIn(file, file_name, problem, j, "a motion to complement")];
    const double begins_rad = motion.joints[j].position.control_points().front();
    if (std::abs(begins_rad - problem.joints[j].start_rad) > kStartJointTolerance) {
      throw FileError(file_name, 0, "joint",
                      fmt::format("'{}' begins at {:.6g} rad, and the task's at {:.6g}; allowed: "
                                  "the same, as one is tried after the other",
                                  NameOf(problem, j), begins_rad, problem.joints[j].start_rad));
    }
  }
  task.complement.push_back(motion);
  task.complement_files.push_back(file_name);
  task.complement_hashes.push_back(ContentHash(file));
}

void CheckGuess(const Task& task) {
  if (!task.guess.empty()) return;
  const auto& robust = task.problem.robust;
  const bool takes = robust && robust->feedback && robust->feedback->from_guess;
  if (!takes && task.problem.guess_mirror.empty()) return;
  throw FileError(task.task_file, 0, takes ? "robust.feedback.from_guess" : "mirror",
                  "is for a task with a guess; name a primitive with --guess, or leave it out");
}

std::vector<double> ParametersOf(const Primitive<double>& primitive) {
  std::vector<double> x;
  for (const JointMotion<double>& motion : primitive.motions()) {
    const std::span<const double> points = motion.position.control_points();
    x.insert(x.end(), points.begin() + 3, points.end() - 3);
  }
  return x;
}

}  // namespace tumbler

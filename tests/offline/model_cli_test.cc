// tumbler-model as a user meets it. What it computes is held against DART, which reads the same
// random URDFs with its own loader.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/DegreeOfFreedom.hpp>
#include <dart/dynamics/Joint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/utils/urdf/DartLoader.hpp>
#include <filesystem>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/program.h"
#include "tests/support/random_robot.h"
#include "tests/support/task_files.h"

namespace tumbler {
namespace {

using ::testing::HasSubstr;
using testing::LineOf;
using testing::Program;
using testing::ReadFile;
using testing::Replaced;
using testing::ShippedRobot;
using testing::WriteFile;

/// What a run of the program printed.
struct Outcome {
  int status = -1;
  std::string out, err;
};

/// A folder with a robot, in which tumbler-model runs; it is gone after the test.
class ModelRunner {
 public:
  explicit ModelRunner(const std::string& robot) {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "tumbler_model_XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
    folder_ = pattern;
    WriteFile(folder_ / "robot.urdf", robot);
  }
  ~ModelRunner() { std::filesystem::remove_all(folder_); }
  ModelRunner(const ModelRunner&) = delete;
  ModelRunner& operator=(const ModelRunner&) = delete;

  /// `tumbler-model COMMAND robot.urdf ARGUMENTS` in a shell, with this on its standard input.
  [[nodiscard]] Outcome operator()(const std::string& command, const std::string& arguments,
                                   const std::string& input = "") const {
    WriteFile(folder_ / "in", input);
    Program shell({"/bin/sh", "-c",
                   fmt::format("cd {} && exec <in >out 2>err && exec {}/bin/tumbler-model {} "
                               "robot.urdf {}",
                               folder_.string(), TUMBLER_BINARY_DIR, command, arguments)});
    Outcome run;
    run.status = shell.Wait();
    run.out = ReadFile(folder_ / "out");
    run.err = ReadFile(folder_ / "err");
    return run;
  }

 private:
  std::filesystem::path folder_;
};

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::vector<double> Numbers(const std::string& line) {
  std::vector<double> numbers;
  std::istringstream stream(line);
  for (double x = 0; stream >> x;) numbers.push_back(x);
  return numbers;
}

std::string Text(const std::vector<double>& numbers) {
  std::string text;
  for (const double x : numbers) text += fmt::format("{} ", x);
  return text;
}

std::string Join(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ","));
}

// ---- random robots ------------------------------------------------------------------------------

struct JointOfFile {
  std::string name;
  bool moves = true;
  double damping = 0;
  bool prescribed_only = false;  ///< Moves no mass.
};

/// A URDF with everything that changes how it must be read, and what a caller needs to know of it.
struct RandomFile {
  std::string links, joints;          ///< The elements.
  std::vector<JointOfFile> in_order;  ///< Joints as the file has them.
  std::vector<std::string> link_names;
  std::vector<std::string> massless;  ///< Links without inertia of their own.

  [[nodiscard]] std::string Urdf(const std::string& more = "") const {
    return fmt::format("<robot name='random'>\n{}{}{}</robot>\n", links, joints, more);
  }
};

std::string Xyz(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v.x(), v.y(), v.z()); }

std::string RandomOrigin(std::mt19937_64& random) {
  return fmt::format("<origin xyz='{}' rpy='{}'/>", Xyz(RandomVector(random, 0.4)),
                     Xyz(RandomVector(random, 3)));
}

std::string RandomInertial(std::mt19937_64& random) {
  const Eigen::Matrix3d I = RandomInertia(random);
  return fmt::format(
      "<inertial>{}<mass value='{}'/><inertia ixx='{}' ixy='{}' ixz='{}' iyy='{}' iyz='{}' "
      "izz='{}'/></inertial>",
      RandomOrigin(random), Uniform(random, 0.2, 2), I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2),
      I(2, 2));
}

RandomFile MakeRandomFile(std::mt19937_64& random) {
  const int n = 2 + static_cast<int>(random() % 10);  // links
  const auto chance = [&random](int one_in) {
    return random() % static_cast<unsigned>(one_in) == 0;
  };
  struct Link {
    int parent = -1;
    bool fixed = false, has_mass = true, carries = false;
  };
  std::vector<Link> tree(static_cast<std::size_t>(n));
  for (std::size_t i = 1; i < tree.size(); ++i) {
    tree[i].parent = static_cast<int>(chance(2) ? i - 1 : random() % i);
    tree[i].fixed = i > 1 && chance(4);
    tree[i].has_mass = !chance(4);
  }
  // Backwards: whether a link, or what it carries, has mass.
  for (std::size_t i = tree.size(); i-- > 0;) {
    tree[i].carries = tree[i].carries || tree[i].has_mass;
    if (i > 0 && tree[i].carries) tree[static_cast<std::size_t>(tree[i].parent)].carries = true;
  }
  RandomFile file;
  std::vector<std::string> links;
  std::vector<std::pair<std::string, JointOfFile>> joints;
  for (std::size_t i = 0; i < tree.size(); ++i) {
    const Link& link = tree[i];
    const std::string name = fmt::format("link_{}", i);
    file.link_names.push_back(name);
    links.push_back(fmt::format("  <link name='{}'>{}</link>\n", name,
                                link.has_mass ? RandomInertial(random) : ""));
    if (!link.has_mass) file.massless.push_back(name);
    if (i == 0) continue;
    JointOfFile joint;
    joint.name = fmt::format("joint_{}", (i * 7919) % 97);  // no order in the names
    joint.moves = !link.fixed;
    joint.prescribed_only = !link.carries;
    const char* const type = link.fixed  ? "fixed"
                             : chance(3) ? "prismatic"
                             : chance(2) ? "continuous"
                                         : "revolute";
    // Two joints in one line with nothing in between would leave the motion undetermined.
    std::string inside = RandomOrigin(random);
    if (tree[static_cast<std::size_t>(link.parent)].has_mass && chance(3))
      inside = chance(2) ? "" : "<origin xyz='0 0 0'/>";
    if (joint.moves) {
      const char* const straight[] = {"1 0 0", "0 -1 0", "0 0 1", "0 0 -1"};
      const Eigen::Vector3d any = RandomDirection(random) * Uniform(random, 0.01, 20);
      if (!chance(6))  // else the default, x
        inside += fmt::format("<axis xyz='{}'/>", chance(3) ? straight[random() % 4] : Xyz(any));
      inside += "<limit lower='-9' upper='9' effort='1e6' velocity='1e6'/>";
      if (chance(2)) {
        joint.damping = Uniform(random, 0, 0.5);
        inside += fmt::format("<dynamics damping='{}'/>", joint.damping);
      }
    }
    joints.emplace_back(
        fmt::format("  <joint name='{}' type='{}'><parent link='link_{}'/><child link='{}'/>{}"
                    "</joint>\n",
                    joint.name, type, link.parent, name, inside),
        joint);
  }
  std::shuffle(links.begin(), links.end(), random);
  if (chance(2)) std::shuffle(joints.begin(), joints.end(), random);
  for (const std::string& link : links) file.links += link;
  for (const auto& [text, joint] : joints) {
    file.joints += text;
    file.in_order.push_back(joint);
  }
  return file;
}

/// The joints that hold the root link, as elements of a URDF, and their names.
struct RootChain {
  std::string urdf;
  std::vector<std::string> names;
  std::vector<std::string> massless;
};

RootChain MakeRoot(const std::string& kind, const std::string& link) {
  struct Coordinate {
    std::string name, type, axis;
  };
  std::vector<Coordinate> chain;
  if (kind == "planar-xz")
    chain = {{"x", "prismatic", "1 0 0"},
             {"z", "prismatic", "0 0 1"},
             {"pitch", "continuous", "0 -1 0"}};
  if (kind == "floating") {
    chain = {{"x", "prismatic", "1 0 0"},     {"y", "prismatic", "0 1 0"},
             {"z", "prismatic", "0 0 1"},     {"pitch", "continuous", "0 -1 0"},
             {"roll", "continuous", "1 0 0"}, {"yaw", "continuous", "0 0 1"}};
  }
  if (kind == "fixed") chain = {{"weld", "fixed", "1 0 0"}};
  RootChain root;
  root.urdf = "  <link name='world'/>\n";
  std::string parent = "world";
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const bool last = i + 1 == chain.size();
    const std::string child = last ? link : fmt::format("carrier_{}", i);
    if (!last) {
      root.urdf += fmt::format("  <link name='{}'/>\n", child);
      root.massless.push_back(child);
    }
    root.urdf += fmt::format(
        "  <joint name='{}' type='{}'><parent link='{}'/><child link='{}'/><axis xyz='{}'/><limit "
        "lower='-1e9' upper='1e9' effort='1e9' velocity='1e9'/></joint>\n",
        chain[i].name, chain[i].type, parent, child, chain[i].axis);
    parent = child;
    if (chain[i].type != "fixed") root.names.push_back(chain[i].name);
  }
  return root;
}

/// DART's model of a file, with coordinates by name in the order of tumbler-model.
class DartRobot {
 public:
  struct Force {
    Eigen::Vector3d force, point;  ///< World axes; in the link's frame.
    std::string link;
  };

  DartRobot(const RandomFile& file, const std::string& root_kind) {
    const RootChain root = MakeRoot(root_kind, "link_0");
    dart::utils::DartLoader loader;
    skeleton_ = loader.parseSkeletonString(file.Urdf(root.urdf), "file:///robot.urdf");
    if (!skeleton_) throw std::runtime_error("DART does not read the robot");
    skeleton_->setGravity({0, 0, -9.81});
    for (const auto* names : {&file.massless, &root.massless}) {
      for (const std::string& link : *names) {  // DART gives them 1 kg.
        dart::dynamics::Inertia none;
        none.setMass(0);
        none.setMoment(0, 0, 0, 0, 0, 0);
        skeleton_->getBodyNode(link)->setInertia(none);
      }
    }
    for (const std::string& name : root.names) {
      coordinates_.push_back(name);
      damping_.push_back(0);
    }
    for (const JointOfFile& joint : file.in_order) {
      if (!joint.moves) continue;
      coordinates_.push_back(joint.name);
      damping_.push_back(joint.damping);
    }
    for (const std::string& name : coordinates_) {
      joints_.push_back(skeleton_->getJoint(name));
      if (joints_.back() == nullptr) throw std::runtime_error("DART has no joint " + name);
      // DART's own damping is implicit in time.
      joints_.back()->setDampingCoefficient(0, 0);
    }
  }

  [[nodiscard]] const std::vector<std::string>& coordinates() const { return coordinates_; }

  void SetState(const std::vector<double>& q, const std::vector<double>& qd) {
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      joints_[i]->setPosition(0, q[i]);
      joints_[i]->setVelocity(0, qd[i]);
    }
  }
  [[nodiscard]] Eigen::Isometry3d PoseOf(const std::string& link) const {
    return skeleton_->getBodyNode(link)->getWorldTransform();
  }

  /// Accelerations of the free coordinates, then torques of the prescribed ones. `input` is the
  /// acceleration of a prescribed coordinate, or the force on a free one.
  std::vector<double> Solve(const std::vector<double>& q, const std::vector<double>& qd,
                            const std::vector<double>& input, const std::vector<bool>& prescribed,
                            const std::vector<Force>& forces) {
    SetState(q, qd);
    skeleton_->clearExternalForces();
    for (const Force& f : forces)
      skeleton_->getBodyNode(f.link)->addExtForce(f.force, f.point, false, true);
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      joints_[i]->setActuatorType(prescribed[i] ? dart::dynamics::Joint::ACCELERATION
                                                : dart::dynamics::Joint::FORCE);
      joints_[i]->setCommand(0, prescribed[i] ? input[i] : input[i] - damping_[i] * qd[i]);
    }
    skeleton_->computeForwardDynamics();
    std::vector<double> out;
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      if (!prescribed[i]) out.push_back(joints_[i]->getAcceleration(0));
    }
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      if (prescribed[i]) out.push_back(joints_[i]->getForce(0) + damping_[i] * qd[i]);
    }
    return out;
  }

 private:
  dart::dynamics::SkeletonPtr skeleton_;
  std::vector<std::string> coordinates_;
  std::vector<double> damping_;
  std::vector<dart::dynamics::Joint*> joints_;
};

/// A random question to the program: its line, and what DART needs to answer it.
struct Question {
  std::vector<double> q, qd, input;
  std::vector<DartRobot::Force> forces;
  std::string line;
};

Question Ask(std::mt19937_64& random, DartRobot& dart, const std::vector<bool>& prescribed,
             const RandomFile& file, const std::string& root) {
  Question question;
  const std::size_t n = dart.coordinates().size();
  for (std::size_t i = 0; i < n; ++i) {
    question.q.push_back(Uniform(random, -3, 3));
    question.qd.push_back(Uniform(random, -4, 4));
    question.input.push_back(prescribed[i] ? Uniform(random, -20, 20) : 0);
  }
  if (root == "floating") question.q[4] = Uniform(random, -1.2, 1.2);
  question.line = Text(question.q) + Text(question.qd);
  for (std::size_t i = 0; i < n; ++i) {
    if (prescribed[i]) question.line += fmt::format("{} ", question.input[i]);
  }
  dart.SetState(question.q, question.qd);
  for (int k = static_cast<int>(random() % 4); k > 0; --k) {
    DartRobot::Force force{RandomVector(random, 30), RandomVector(random, 0.3),
                           file.link_names[random() % file.link_names.size()]};
    const Eigen::Vector3d point = dart.PoseOf(force.link) * force.point;
    question.line += fmt::format("{} {} {} ", Xyz(force.force), Xyz(point), force.link);
    question.forces.push_back(std::move(force));
  }
  question.line += "\n";
  return question;
}

/// Which coordinates of a robot are prescribed, at random.
std::vector<bool> ChoosePrescribed(std::mt19937_64& random, const RandomFile& file,
                                   std::size_t root_dofs) {
  std::vector<bool> prescribed(root_dofs, false);
  for (const JointOfFile& joint : file.in_order) {
    if (joint.moves) prescribed.push_back(joint.prescribed_only || random() % 2 == 0);
  }
  return prescribed;
}

std::string Options(const std::string& root, const DartRobot& dart,
                    const std::vector<bool>& prescribed) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < prescribed.size(); ++i) {
    if (prescribed[i]) names.push_back(dart.coordinates()[i]);
  }
  std::reverse(names.begin(), names.end());  // The order on the command line does not count.
  return fmt::format("--root {} --prescribed '{}'", root, Join(names));
}

TEST(ModelHybrid, AgreesWithDartOnRandomFiles) {
  std::mt19937_64 random(81);
  for (int robot = 0; robot < 120; ++robot) {
    const RandomFile file = MakeRandomFile(random);
    const std::string root = std::vector<std::string>{"planar-xz", "fixed", "floating"}[robot % 3U];
    SCOPED_TRACE(fmt::format("robot {} {}\n{}", robot, root, file.Urdf()));
    DartRobot dart(file, root);
    const std::size_t moving = static_cast<std::size_t>(
        std::count_if(file.in_order.begin(), file.in_order.end(),
                      [](const JointOfFile& joint) { return joint.moves; }));
    const std::vector<bool> prescribed =
        ChoosePrescribed(random, file, dart.coordinates().size() - moving);
    std::vector<Question> questions;
    std::string input;
    for (int state = 0; state < 20; ++state) {
      questions.push_back(Ask(random, dart, prescribed, file, root));
      input += questions.back().line;
    }
    const ModelRunner model(file.Urdf());
    const Outcome run = model("hybrid", Options(root, dart, prescribed), input);
    ASSERT_EQ(run.status, 0) << run.err;
    const std::vector<std::string> lines = Lines(run.out);
    ASSERT_EQ(lines.size(), questions.size());
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const Question& question = questions[k];
      const std::vector<double> ours = Numbers(lines[k]);
      const std::vector<double> theirs =
          dart.Solve(question.q, question.qd, question.input, prescribed, question.forces);
      ASSERT_EQ(ours.size(), theirs.size());
      for (std::size_t i = 0; i < ours.size(); ++i) {
        EXPECT_NEAR(ours[i], theirs[i], 1e-9 * (1 + std::abs(theirs[i])))
            << "state " << k << " value " << i;
      }
    }
  }
}

TEST(ModelHybrid, DerivativesAreThoseOfDartWithForcesThatStayAndPointsThatMove) {
  std::mt19937_64 random(82);
  for (int robot = 0; robot < 24; ++robot) {
    const RandomFile file = MakeRandomFile(random);
    const std::string root = std::vector<std::string>{"planar-xz", "fixed", "floating"}[robot % 3U];
    SCOPED_TRACE(fmt::format("robot {} {}\n{}", robot, root, file.Urdf()));
    DartRobot dart(file, root);
    const std::size_t n = dart.coordinates().size();
    const std::size_t moving = static_cast<std::size_t>(
        std::count_if(file.in_order.begin(), file.in_order.end(),
                      [](const JointOfFile& joint) { return joint.moves; }));
    const std::vector<bool> prescribed = ChoosePrescribed(random, file, n - moving);
    const Question question = Ask(random, dart, prescribed, file, root);
    const ModelRunner model(file.Urdf());
    const Outcome run =
        model("hybrid", Options(root, dart, prescribed) + " --derivatives", question.line);
    ASSERT_EQ(run.status, 0) << run.err;
    const std::vector<double> ours = Numbers(run.out);
    ASSERT_EQ(ours.size(), n + 3 * n * n);
    double scale = 1;
    for (const double value : ours) scale = std::max(scale, std::abs(value));
    const double h = 1e-3;
    for (std::size_t kind = 0; kind < 3; ++kind) {
      for (std::size_t k = 0; k < n; ++k) {
        const auto shifted = [&](double step) {
          Question q = question;
          (kind == 0 ? q.q : kind == 1 ? q.qd : q.input)[k] += step;
          return dart.Solve(q.q, q.qd, q.input, prescribed, q.forces);
        };
        const auto p1 = shifted(h), m1 = shifted(-h), p2 = shifted(2 * h), m2 = shifted(-2 * h);
        for (std::size_t i = 0; i < n; ++i) {
          const double difference = (8 * (p1[i] - m1[i]) - (p2[i] - m2[i])) / (12 * h);
          EXPECT_NEAR(ours[n + kind * n * n + i * n + k], difference, 1e-7 * scale)
              << "kind " << kind << " row " << i << " column " << k;
        }
      }
    }
  }
}

/// The robot of the figures that several engines agree on: legs 0.25 m long, boxes 40 mm thick.
std::string BoxTumbler() {
  const auto inertial = [](double mass, double length, double x) {
    const double across = mass * (length * length + 0.04 * 0.04) / 12;
    return fmt::format(
        "<inertial><origin xyz='{} 0 0'/><mass value='{}'/><inertia ixx='{}' ixy='0' ixz='0' "
        "iyy='{}' iyz='0' izz='{}'/></inertial>",
        x, mass, mass * 2 * 0.04 * 0.04 / 12, across, across);
  };
  const auto leg = [](const char* name, double x) {
    return fmt::format(
        "<joint name='{0}' type='continuous'><parent link='body'/><child link='{0}_link'/><origin "
        "xyz='{1} 0 0'/><axis xyz='0 -1 0'/></joint>\n",
        name, x);
  };
  return fmt::format(
      "<robot name='boxes'>\n<link name='body'>{}</link>\n<link name='leg_a_link'>{}</link>\n"
      "<link name='leg_b_link'>{}</link>\n{}{}</robot>\n",
      inertial(1, 0.3, 0), inertial(0.4, 0.25, -0.125), inertial(0.4, 0.25, 0.125),
      leg("leg_a", -0.15), leg("leg_b", 0.15));
}
const char* const kBoxState = "0.1 0.2 0.3 0.4 0.5  1 2 3 4 5  0.1 0.2";
const char* const kLegs = "--prescribed leg_a,leg_b";

TEST(ModelHybrid, GivesTheValuePublishedByThreeOtherEngines) {
  const Outcome run = ModelRunner(BoxTumbler())("hybrid", kLegs, kBoxState);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.err, "");
  const std::vector<double> out = Numbers(run.out);
  const std::vector<double> published = {0.208891784734129, -9.40478201383283, 4.49958658129138,
                                         0.0871760888152076, 0.108014195159789};
  ASSERT_EQ(out.size(), published.size());
  for (std::size_t i = 0; i < out.size(); ++i) EXPECT_NEAR(out[i], published[i], 1e-12);
}

TEST(ModelHybrid, SkipsCommentsAndBlankLinesAndTakesAnEmptyInput) {
  const ModelRunner model(BoxTumbler());
  const std::string state = kBoxState;
  const Outcome plain = model("hybrid", kLegs, state + "\n");
  const Outcome run = model(
      "hybrid", kLegs,
      "# states\n\n  \t\r\n" + state + "\r\n   # another\n+" + state + " # the same\n" + state);
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_EQ(run.out, plain.out + plain.out + plain.out);
  const Outcome none = model("hybrid", kLegs, "");
  EXPECT_EQ(none.status, 0);
  EXPECT_EQ(none.out, "");
  EXPECT_EQ(none.err, "");
}

TEST(ModelHybrid, PrintsDigitsThatReadBackToTheSameNumber) {
  const Outcome run = ModelRunner(BoxTumbler())("hybrid", kLegs, kBoxState);
  std::string again;
  for (const double x : Numbers(run.out)) again += fmt::format("{:.17g} ", x);
  again.back() = '\n';
  EXPECT_EQ(run.out, again);
}

TEST(ModelHybrid, GravityCanBeAnotherOne) {
  const ModelRunner model(BoxTumbler());
  const std::string rest = "0 0 0 0 0  0 0 0 0 0  0 0\n";
  const std::vector<double> out =
      Numbers(model("hybrid", std::string(kLegs) + " --gravity 1.5 0 -2", rest).out);
  ASSERT_EQ(out.size(), 5U);
  EXPECT_NEAR(out[0], 1.5, 1e-14);
  EXPECT_NEAR(out[1], -2, 1e-14);
  const std::vector<double> ahead = Numbers(model("hybrid --gravity 1.5 0 -2", kLegs, rest).out);
  EXPECT_EQ(ahead, out) << "the robot's file follows the option";
}

TEST(ModelHybrid, ARootsCoordinateMayBePrescribedToo) {
  // Held at rest, the robot weighs 1.8 kg on z, and as much as its first moment on pitch.
  const std::vector<double> out =
      Numbers(ModelRunner(BoxTumbler())("hybrid", "--prescribed leg_b,x,leg_a,pitch,z",
                                        "0 0 0 0 0  0 0 0 0 0  0 0 0 0 0")
                  .out);
  ASSERT_EQ(out.size(), 5U);
  EXPECT_NEAR(out[1], 1.8 * 9.81, 1e-13);
  EXPECT_NEAR(out[3], -0.4 * 9.81 * 0.125, 1e-13) << "leg_a";
  EXPECT_NEAR(out[4], 0.4 * 9.81 * 0.125, 1e-13) << "leg_b";
}

TEST(ModelHybrid, AMalformedLineIsNamedAndWhatCameBeforeItIsPrinted) {
  const ModelRunner model(BoxTumbler());
  const std::string state = kBoxState;
  const std::string before = model("hybrid", kLegs, state).out;
  struct Wrong {
    std::string line, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"1 2 3", "has 3 values; expected 12: 5 positions, 5 velocities, 2 prescribed"},
           {state + " 1", "has 13 values; expected 12"},
           {state + " 1 2 3 4 5 6", "7 more for each force: fx fy fz px py pz link"},
           {"0.1 0.2 0.3 0.4 x 1 2 3 4 5 0.1 0.2",
            "value 5, the position of 'leg_b', is 'x'; expected a finite number"},
           {"0.1 0.2 0.3 0.4 5 1 nan 3 4 5 0.1 0.2", "value 7, the velocity of 'z', is 'nan'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 inf", "the acceleration of 'leg_b', is 'inf'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 0x1", "is '0x1'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 1e999", "is '1e999'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 1,5", "is '1,5'"},
           {"0.1 0.2 0.3 0.4 5 1 2 3 4 5 0.1 +-1", "is '+-1'"},
           {state + " 1 2 3 4 5 body body", "value 18, the pz of force 1, is 'body'"},
           {state + " 1 2 3 4 5 6 body 1 2 3 4 5 6 leg_c",
            "value 26, the link of force 2, is 'leg_c'; expected one of: body, leg_a_link, "
            "leg_b_link"},
           {"0.1 0.2 0.3 0.4 0.5 1e200 2 1e200 4 5 0.1 0.2", "not a finite number"}}) {
    const Outcome run =
        model("hybrid", kLegs, "# first\n" + state + "\n" + wrong.line + "\n" + state + "\n");
    EXPECT_EQ(run.status, 1) << wrong.line;
    EXPECT_EQ(run.out, before) << wrong.line;
    EXPECT_THAT(run.err, HasSubstr("standard input:3: ")) << wrong.line;
    EXPECT_THAT(run.err, HasSubstr(wrong.says)) << wrong.line;
  }
}

TEST(ModelHybrid, StandardStreamsThatFailAreErrors) {
  const ModelRunner model(BoxTumbler());
  const Outcome full = model("hybrid", std::string(kLegs) + " >/dev/full", kBoxState);
  EXPECT_EQ(full.status, 1);
  EXPECT_THAT(full.err, HasSubstr("standard output: "));
  const Outcome folder = model("hybrid", std::string(kLegs) + " </", "");
  EXPECT_EQ(folder.status, 1);
  EXPECT_THAT(folder.err, HasSubstr("standard input: cannot be read"));
}

TEST(ModelHybrid, BadArgumentsAreNamed) {
  const ModelRunner model(BoxTumbler());
  struct Wrong {
    std::string arguments, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"--prescribed leg_a,leg_c",
            "'leg_c' is no joint that moves; allowed, separated by commas: x, z, pitch, leg_a, "
            "leg_b"},
           {"--prescribed leg_a,leg_a", "'leg_a' is there twice"},
           {"--root hanging", "hanging"},
           {"--gravity 0 0", "--gravity"},
           {"--gravity 0 0 nan", "--gravity"}}) {
    const Outcome run = model("hybrid", wrong.arguments, kBoxState);
    EXPECT_EQ(run.status, 1) << wrong.arguments;
    EXPECT_EQ(run.out, "") << wrong.arguments;
    EXPECT_THAT(run.err, HasSubstr(wrong.says)) << wrong.arguments;
  }
}

TEST(ModelHybrid, TheFloatingRootsSingularityIsNamedAndVerticalPitchIsNone) {
  const ModelRunner model(BoxTumbler());
  const std::string rest = " 0 0 0 0 0 0 0 0\n";
  const Outcome steep =
      model("hybrid", "--root floating", "1 2 3 1.5707963267948966 0 0.3 0.4 0.5" + rest);
  EXPECT_EQ(steep.status, 0) << steep.err;
  EXPECT_NEAR(Numbers(steep.out).at(2), -9.81, 1e-12);
  const Outcome singular =
      model("hybrid", "--root floating", "1 2 3 0.2 -1.5707963267948966 0.3 0.4 0.5" + rest);
  EXPECT_EQ(singular.status, 1);
  EXPECT_EQ(singular.out, "");
  EXPECT_THAT(singular.err, HasSubstr("standard input:1: roll = -1.57079633 rad"));
}

TEST(ModelHybrid, ADegreeOfFreedomWithoutInertiaMustBePrescribed) {
  const std::string text = Replaced(BoxTumbler(), "</robot>",
                                    "<link name='tip'/>\n<joint name='wrist' type='continuous'>"
                                    "<parent link='body'/><child link='tip'/></joint>\n</robot>");
  const ModelRunner model(text);
  const Outcome free = model("hybrid", kLegs, "");
  EXPECT_EQ(free.status, 1);
  EXPECT_THAT(free.err, HasSubstr(fmt::format("robot.urdf:{}: link 'tip': degree of freedom "
                                              "'wrist' moves no mass",
                                              LineOf(text, "<link name='tip'"))));
  const Outcome given = model("hybrid", "--prescribed wrist", "0 0 0 0 0 0  0 0 0 0 0 0  1");
  EXPECT_EQ(given.status, 0) << given.err;
  EXPECT_EQ(Numbers(given.out).back(), 0);
  const Outcome check = model("check", "");
  EXPECT_EQ(check.status, 0);
  EXPECT_THAT(check.out, HasSubstr("'wrist' moves no mass: it can only be prescribed"));
}

TEST(ModelCheck, ShowsCoordinatesMassesAndWhatIsIgnored) {
  const std::string text =
      Replaced(ShippedRobot(), "<sphere radius=\"0.03\"/>", "<mesh filename=\"a.stl\"/>");
  const Outcome run = ModelRunner(text)("check", "");
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("robot 'tumbler', root link 'middle' free in the x-z plane"));
  EXPECT_THAT(run.out, HasSubstr("degrees of freedom: 5"));
  EXPECT_THAT(run.out,
              ::testing::ContainsRegex("leg1 +revolute +\\(0, -1, 0\\) +-2.9 +2.9 +20 +8"));
  EXPECT_THAT(run.out, ::testing::ContainsRegex("leg2_link +0.4 +moved by leg2"));
  EXPECT_THAT(run.out, ::testing::ContainsRegex("total, moving +1.8\n"));
  EXPECT_THAT(run.out, HasSubstr(fmt::format("robot.urdf:{}: link 'middle': note: collision shape "
                                             "middle/0 is a mesh: contact ignores it",
                                             LineOf(text, "<link name=\"middle\""))));
  EXPECT_THAT(run.out, HasSubstr("tumbler-optimize takes it"));
  const Outcome floating = ModelRunner(text)("check", "--root floating");
  EXPECT_EQ(floating.status, 0);
  EXPECT_THAT(floating.out, HasSubstr("degrees of freedom: 8"));
  EXPECT_THAT(floating.out, HasSubstr("tumbler-optimize does not take it"));
}

TEST(ModelCheck, WarnsOfInertiaThatNoBodyHasWithLinkAndLine) {
  const std::string text = Replaced(ShippedRobot(), "iyy=\"7.5e-3", "iyy=\"9.5e-3");
  const Outcome run = ModelRunner(text)("check", "--root floating");
  EXPECT_EQ(run.status, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr(fmt::format("robot.urdf:{}: link 'middle': warning: inertia is "
                                             "that of no body",
                                             LineOf(text, "iyy=\"9.5e-3"))));
  const std::string negative = Replaced(ShippedRobot(), "iyy=\"7.5e-3", "iyy=\"-7.5e-3");
  EXPECT_THAT(ModelRunner(negative)("check", "").out,
              HasSubstr("link 'middle': warning: inertia has the principal moment -0.0075"));
}

TEST(ModelCheck, RefusesWhatIsNoRobotWithFileLineAndElement) {
  struct Wrong {
    std::string from, to, says;
  };
  for (const Wrong& wrong : std::vector<Wrong>{
           {"<mass value=\"1.0\"", "<mass value=\"-1\"", "inertial mass is -1 kg; allowed: > 0"},
           {"lower=\"-2.9", "lower=\"29", "limit lower = 29 upper = 2.9"},
           {"<axis xyz=\"0 -1 0\"", "<axis xyz=\"0 0 0\"", "has no direction"},
           {"type=\"revolute\"", "type=\"planar\"", "type"},
           {"<mass value=\"1.0\"", "<mass value=\"heavy\"", "allowed: a finite number"},
           {"</robot>", "<link name='alone'/></robot>", "no joint carries it"}}) {
    const std::string text = Replaced(ShippedRobot(), wrong.from, wrong.to);
    for (const char* command : {"check", "hybrid"}) {
      const Outcome run = ModelRunner(text)(command, "--root floating");
      EXPECT_EQ(run.status, 1) << wrong.to;
      EXPECT_EQ(run.out, "") << wrong.to;
      EXPECT_THAT(run.err, HasSubstr(fmt::format("robot.urdf:{}: ", LineOf(text, wrong.to))));
      EXPECT_THAT(run.err, HasSubstr(wrong.says));
    }
  }
}

}  // namespace
}  // namespace tumbler

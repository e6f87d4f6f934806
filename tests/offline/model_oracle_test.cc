// Compares the results of tumbler model with DART, which reads the same random URDFs with its own
// loader.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/DegreeOfFreedom.hpp>
#include <dart/dynamics/Joint.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <dart/utils/urdf/DartLoader.hpp>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/support/model_runner.h"
#include "tests/support/random_robot.h"
#include "tests/support/to_eigen.h"

namespace tumbler {
namespace {

using testing::Lines;
using testing::ModelRunner;
using testing::Numbers;
using Outcome = testing::ModelOutcome;

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
  bool prescribed_only = false;  ///< It moves no mass, so it cannot be free.
};

/// A URDF with everything that readers have to pay attention to, and its content.
struct RandomFile {
  std::string links, joints;          ///< The elements.
  std::vector<JointOfFile> in_order;  ///< The joints in the order of the file.
  std::vector<std::string> link_names;
  std::vector<std::string> massless;  ///< Links without inertia of their own.

  [[nodiscard]] std::string Urdf(const std::string& more = "") const {
    return fmt::format("<robot name='random'>\n{}{}{}</robot>\n", links, joints, more);
  }
};

template <class Vector>
std::string Xyz(const Vector& v) {
  return fmt::format("{} {} {}", v.x(), v.y(), v.z());
}

std::string RandomOrigin(std::mt19937_64& random) {
  return fmt::format("<origin xyz='{}' rpy='{}'/>", Xyz(RandomVector(random, 0.4)),
                     Xyz(RandomVector(random, 3)));
}

std::string RandomInertial(std::mt19937_64& random) {
  const SpaceMatrix I = RandomInertia(random);
  return fmt::format(
      "<inertial>{}<mass value='{}'/><inertia ixx='{}' ixy='{}' ixz='{}' iyy='{}' iyz='{}' "
      "izz='{}'/></inertial>",
      RandomOrigin(random), Uniform(random, 0.2, 2), I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2),
      I(2, 2));
}

RandomFile MakeRandomFile(std::mt19937_64& random) {
  const int n = 2 + static_cast<int>(random() % 10);  // number of links
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
  // Going backwards tells whether a link, or anything that it carries, has mass.
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
    joint.name = fmt::format("joint_{}", (i * 7919) % 97);  // The names are in no order.
    joint.moves = !link.fixed;
    joint.prescribed_only = !link.carries;
    const char* const type = link.fixed  ? "fixed"
                             : chance(3) ? "prismatic"
                             : chance(2) ? "continuous"
                                         : "revolute";
    // Two joints along one line, with no mass between them, would leave the motion undetermined.
    std::string inside = RandomOrigin(random);
    if (tree[static_cast<std::size_t>(link.parent)].has_mass && chance(3))
      inside = chance(2) ? "" : "<origin xyz='0 0 0'/>";
    if (joint.moves) {
      const char* const straight[] = {"1 0 0", "0 -1 0", "0 0 1", "0 0 -1"};
      const SpaceVector any = RandomDirection(random) * Uniform(random, 0.01, 20);
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

/// The joints that connect the root link to the world: elements of a URDF, and their names.
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
  if (kind == "planar-xz") {
    chain = {{"x", "prismatic", "1 0 0"},
             {"z", "prismatic", "0 0 1"},
             {"pitch", "continuous", "0 -1 0"}};
  }
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

/// DART's model of a file, with coordinates by name in the order of tumbler model.
class DartRobot {
 public:
  struct Force {
    Eigen::Vector3d force, point;  ///< The force is in world axes, the point in the link's frame.
    std::string link;
  };

  DartRobot(const RandomFile& file, const std::string& root_kind) {
    const RootChain root = MakeRoot(root_kind, "link_0");
    dart::utils::DartLoader loader;
    skeleton_ = loader.parseSkeletonString(file.Urdf(root.urdf), "file:///robot.urdf");
    if (!skeleton_) throw std::runtime_error("DART does not read the robot");
    skeleton_->setGravity({0, 0, -9.81});
    for (const auto* names : {&file.massless, &root.massless}) {
      for (const std::string& link : *names) {  // DART has given them 1 kg.
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

  /// The accelerations of the free coordinates, then the torques of the prescribed ones.
  /// @param input  the acceleration of each prescribed coordinate, and the force on each free one.
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

/// A random question: the line for the program, and the same numbers for DART.
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
    DartRobot::Force force{ToEigen(RandomVector(random, 30)), ToEigen(RandomVector(random, 0.3)),
                           file.link_names[random() % file.link_names.size()]};
    const Eigen::Vector3d point = dart.PoseOf(force.link) * force.point;
    question.line += fmt::format("{} {} {} ", Xyz(force.force), Xyz(point), force.link);
    question.forces.push_back(std::move(force));
  }
  question.line += "\n";
  return question;
}

/// Chooses at random which coordinates of a robot are prescribed.
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
  if (names.empty()) return fmt::format("--root {}", root);
  return fmt::format("--root {} --prescribed {}", root, Join(names));
}

TEST(ModelOracle, AgreesWithDartOnRandomFiles) {
  std::mt19937_64 random(81);
  for (unsigned robot = 0; robot < 120; ++robot) {
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

TEST(ModelOracle, DerivativesAreThoseOfDartWithForcesThatStayAndPointsThatMove) {
  std::mt19937_64 random(82);
  for (unsigned robot = 0; robot < 24; ++robot) {
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

}  // namespace
}  // namespace tumbler

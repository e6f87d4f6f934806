#include "offline/programs/new_robot.h"

#include <fmt/format.h>

#include <algorithm>

namespace tumbler {
namespace {

std::string Urdf(const std::string& name, int joints) {
  std::string text = fmt::format(R"(<?xml version="1.0"?>
<!--
  {0}: a foot, and an arm of {1} motor{2}. SI units. `tumbler model check {0}.urdf` says what it holds.
  The first link is the root, here the foot: x forward, z up, its frame on the axis of the first motor, 40 mm above the
  ground. Axes are -y, so that angles grow with the pitch of what they turn. An angle is 0 when the link goes straight on
  from the one before, upwards from the foot; joint1 = -pi/2 lays the arm down in front of the foot.
  Contact is spheres: the foot stands on a heel and a toe, and each link ends in a ball as high as the foot, so that the
  arm can lie on the ground without torque. Links are uniform rods of 150 mm.
  Yours differs: change it, or put another file in its place. Only motion in the plane of x and z is found.
-->
<robot name="{0}">
  <link name="foot">
    <inertial>
      <origin xyz="0 0 -0.03"/>
      <mass value="6.0"/>
      <inertia ixx="6.0e-3" ixy="0" ixz="0" iyy="2.0e-2" iyz="0" izz="2.5e-2"/>
    </inertial>
    <visual>
      <origin xyz="0 0 -0.03"/>
      <geometry><box size="0.19 0.10 0.02"/></geometry>
    </visual>
    <collision>
      <origin xyz="0.095 0 -0.03"/>
      <geometry><sphere radius="0.01"/></geometry>
    </collision>
    <collision>
      <origin xyz="-0.095 0 -0.03"/>
      <geometry><sphere radius="0.01"/></geometry>
    </collision>
  </link>
)",
                                 name, joints, joints == 1 ? "" : "s");
  for (int j = 1; j <= joints; ++j) {
    text += fmt::format(R"(
  <link name="link{0}">
    <inertial>
      <origin xyz="0 0 0.075"/>
      <mass value="0.1"/>
      <inertia ixx="1.9e-4" ixy="0" ixz="0" iyy="1.9e-4" iyz="0" izz="1.0e-5"/>
    </inertial>
    <visual>
      <origin xyz="0 0 0.075"/>
      <geometry><cylinder radius="0.01" length="0.15"/></geometry>
    </visual>
    <collision>
      <origin xyz="0 0 0.15"/>
      <geometry><sphere radius="0.04"/></geometry>
    </collision>
  </link>
  <joint name="joint{0}" type="revolute">
    <parent link="{1}"/>
    <child link="link{0}"/>
    <origin xyz="0 0 {2}"/>
    <axis xyz="0 -1 0"/>
    <limit lower="-2.0" upper="2.0" effort="8.0" velocity="20.0"/>
  </joint>
)",
                        j, j == 1 ? "foot" : fmt::format("link{}", j - 1), j == 1 ? "0" : "0.15");
  }
  return text + "</robot>\n";
}

/// The pose of the arm as a table: the first joint at an angle, the others straight.
std::string PoseText(int joints, const std::string& first) {
  std::string text = "{ joint1 = " + first;
  for (int j = 2; j <= joints; ++j) text += fmt::format(", joint{} = 0.0", j);
  return text + " }";
}

std::string TaskText(const std::string& name, int joints, bool rise) {
  constexpr const char* kLying = "-1.5707963267948966";
  return fmt::format(R"(# {0}
#   tumbler optimize {1}
# finds it: {2}. Every key is in docs/formats.md.
format = "tumbler-task"
version = 1
name = "{3}"
robot = "../{4}.urdf"
root = "planar-xz"        # the foot is free in the plane of x and z; "fixed" bolts it down
duration_s = {7}
settle_s = 0.3            # joints held; the cost looks at its end, so the motion must arrive calm

[start]                   # at rest on the ground in this shape; with --start-from, where that motion ends
pitch_rad = 0.0
joints_rad = {5}

[end]
joints_rad = {6}

[spline]
degree = 5
control_points = 10       # per joint; the first and last three are fixed by rest at the ends

[limits]                  # position, velocity and torque limits are the URDF's unless tightened here
acceleration_max_rad_s2 = 200.0
rotor_inertia_kg_m2 = 0.001

[[cost]]                  # what the motion is for: the foot flat on the ground in the end. It has to be reached
term = "terminal"
of = "pitch"
when = "settled"
target = 0.0
weight = 10.0

[[cost]]                  # ... and at rest
term = "terminal"
of = "pitch_rate"
when = "settled"
weight = 1.0

[[cost]]                  # of all such motions, one that asks little of the motors
term = "effort"
weight = 1.0e-2

[contact]                 # how spheres and ground push each other apart, and grip
stiffness_n_per_m = 5.0e3
damping_n_s_per_m = 20.0
d_on_m = 0.01
d_off_m = 0.0075
mu = 0.5
v_max_m_per_s = 0.2

[[obstacle]]
name = "ground"
kind = "half-space"
point_m = [0.0, 0.0]
normal = [0.0, 1.0]

[search]
seed = 1                  # another one finds another motion
spread_rad = 1.0          # how far they go off the straight way
max_samples = 100         # random motions that are tried first
promising = 3
refine = 3                # the best of them are solved ...

[solver]
max_evaluations = 60      # ... with so many evaluations each
# step_s = 4.0e-4         # of the simulation; without it, what the contact law advises
)",
                     rise ? "The arm rises from the ground." : "The arm lies down again.",
                     rise ? "tasks/rise.toml --out motions/rise.toml"
                          : "tasks/lie.toml --start-from motions/rise.toml --out motions/lie.toml",
                     rise ? "no guess of the motion is given"
                          : "it begins where the other motion leaves the robot",
                     rise ? "rise" : "lie", name, PoseText(joints, rise ? kLying : "0.0"),
                     PoseText(joints, rise ? "0.0" : kLying), joints <= 4 ? "1.2" : "1.8");
}

std::string SequenceText(const std::string& name) {
  return fmt::format(
      R"(# Rising and lying down, again and again. `tumbler chain check {0}.toml` says whether the motions fit each other.
format = "tumbler-sequence"
version = 1
name = "{0}"
start = "rise"

[primitives]
rise = "motions/rise.toml"
lie = "motions/lie.toml"

[[node]]                  # upright, the arm would fall without torque: not safe, so no run ends here
name = "rise"
primitive = "rise"

[[node]]                  # lying, it stays where it is
name = "lie"
primitive = "lie"
safe = true
ends_cycle = true         # what --cycles counts

[[edge]]
from = "rise"
to = "lie"
settle_s = 2.0            # time to come to rest, before the next motion may begin

[[edge]]
from = "lie"
to = "rise"
settle_s = 2.0
)",
      name);
}

std::string Drives(const std::string& name, int joints) {
  std::string text = fmt::format(
      R"(# The motor drives of {0} and their bus: imagined ones, of the MIT mini-cheetah kind. Before you drive real motors,
# make this file from them: `tumbler bench`, docs/commissioning.md. Other protocols: docs/protocols.md.
format = "tumbler-drives"
version = 1

[bus]
bit_rate = 1_000_000      # bit/s
rate_hz = {1}             # of the control loop; the bus carries one frame to and one from each drive in every cycle
)",
      name, NewRobotRate(joints));
  for (int j = 1; j <= joints; ++j) {
    text += fmt::format(
        R"(
[[drive]]
joint = "joint{0}"         # as in {3}.urdf
protocol = "mit"
command_id = {0}{4}
reply_id = {1}{5}
direction = 1{6}
gear_ratio = 1.0
zero_offset_rad = 0.0{7}
kp_nm_per_rad = 100.0{8}
kd_nm_s_per_rad = 2.0
temperature_max_c = 80.0{9}
temperature_encoding = "signed"
watchdog_s = {2}{10}
  [drive.range]{11}
  position_rad = [-12.5, 12.5]
  velocity_rad_s = [-50.0, 50.0]
  kp_nm_per_rad = [0.0, 500.0]
  kd_nm_s_per_rad = [0.0, 5.0]
  torque_nm = [-18.0, 18.0]
)",
        j, j + 16, 25.0 / NewRobotRate(joints), name,
        j == 1 ? "            # the drive's CAN_ID" : "",
        j == 1 ? "             # the drive's CAN_MASTER; each drive needs its own" : "",
        j == 1 ? "             # -1 where the drive turns against the joint" : "",
        j == 1 ? "     # the joint's angle when the drive reads zero" : "",
        j == 1 ? "     # gains at the joint" : "", j == 1 ? "  # the run stops above it" : "",
        j == 1 ? "        # silence after which the drive lets go" : "",
        j == 1 ? "           # compiled into the drive's firmware" : "");
  }
  return text;
}

std::string Twin(const std::string& name) {
  return fmt::format(
      R"(# The simulated robot as it is, where it is not as {0}.urdf says. Every key may be left out; docs/formats.md has them all.
format = "tumbler-twin"
version = 1
motion = "{0}.toml"
drives = "drives.toml"

[motor]                          # of every joint; [motor.joint1] is for one. Friction: the tasks', unless it is here
torque_max_nm = 8.0
# viscous_friction_nm_s_per_rad = 0.02
# dry_friction_nm = 0.1

[mass_factor]                    # of mass and inertia: try 1.2
link1 = 1.0

# [[push]]                       # what happens to it
# link = "link1"
# start_s = 3.0
# duration_s = 0.1
# force_n = [5.0, 0.0]           # x, z in the world
# point_m = [0.0, 0.0]           # in the link's frame
)",
      name);
}

std::string Readme(const std::string& name) {
  return fmt::format(R"(# {0}

In this folder:

    tumbler optimize tasks/rise.toml --out motions/rise.toml --report report
    tumbler optimize tasks/lie.toml --start-from motions/rise.toml --out motions/lie.toml
    tumbler run sim {0}.toml --cycles 2 --twin twin.toml

`report/index.html` shows the motion. `{0}.urdf` is the robot, `tasks/` say what it should do, `{0}.toml` puts motions in
a sequence, `drives.toml` describes its motors, `twin.toml` the simulated robot. docs/own-robot.md says how to go on.
)",
                     name);
}

}  // namespace

bool IsRobotName(const std::string& name) {
  const auto small = [](char c) { return c >= 'a' && c <= 'z'; };
  return !name.empty() && name.size() <= 32 && small(name.front()) &&
         std::ranges::all_of(
             name, [small](char c) { return small(c) || (c >= '0' && c <= '9') || c == '-'; });
}

int NewRobotRate(int joints) {
  return joints <= 2 ? 1000 : joints <= 5 ? 500 : joints <= 14 ? 250 : 100;
}

std::vector<NewFile> NewRobot(const std::string& name, int joints) {
  return {{name + ".urdf", Urdf(name, joints)},
          {"tasks/rise.toml", TaskText(name, joints, true)},
          {"tasks/lie.toml", TaskText(name, joints, false)},
          {name + ".toml", SequenceText(name)},
          {"drives.toml", Drives(name, joints)},
          {"twin.toml", Twin(name)},
          {"README.md", Readme(name)}};
}

}  // namespace tumbler

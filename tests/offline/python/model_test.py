"""The equations of motion in Python, against tumbler model's in space and against differences."""

import pickle
import subprocess
import sys

import numpy as np
import support
import tumbler

TASK = tumbler.Task.load(support.PRIMITIVES / "tasks/nominal/handstand.toml")
# The rotors are the task's, of which the robot's file knows nothing.
PLAIN = TASK.replace({"limits.rotor_inertia_kg_m2": None})


def some_states(model, count, seed=1):
    random = np.random.default_rng(seed)
    n = len(model.coordinates)
    return random.normal(size=(count, n)), random.normal(size=(count, n)), random.normal(size=(count, n))


class Dynamics(support.WithFolder):
    def lines_of_program(self, model, q, qd, input):
        """What tumbler model says of the states: results of free coordinates and prescribed ones, and derivatives."""
        given = np.array(model.prescribed)
        names = [name for name, prescribed in zip(model.coordinates, model.prescribed) if prescribed]
        states = "\n".join(" ".join(f"{x:.17g}" for x in (*a, *b, *c[given])) for a, b, c in zip(q, qd, input))
        command = [self.programs / "tumbler", "model", "hybrid", TASK.robot_file, "--derivatives"]
        command += ["--prescribed", ",".join(names)]
        done = subprocess.run(command, input=states + "\n", capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])

    def test_g_and_dg_in_the_air_are_those_of_the_robot_in_space(self):
        model = PLAIN.model
        given, n = np.array(model.prescribed), len(model.coordinates)
        q, qd, input = some_states(model, 20)
        input[:, ~given] = 0  # The program's free coordinates have no force of their own.
        expected = self.lines_of_program(model, q, qd, input)
        order = [*np.flatnonzero(~given), *np.flatnonzero(given)]
        got = model.g(q, qd, input, contact=False)[:, order]
        np.testing.assert_allclose(got, expected[:, :n], rtol=1e-9, atol=1e-9)
        blocks = expected[:, n:].reshape(len(q), 3, n, n)
        for place, matrix in enumerate(model.dg(q, qd, input, contact=False)):
            np.testing.assert_allclose(matrix[:, order], blocks[:, place], rtol=1e-8, atol=1e-8)

    def test_dg_is_the_slope_of_g_on_the_ground(self):
        model = TASK.model
        q, qd, input = some_states(model, 5, seed=2)
        q = model.start + 0.001 * q
        self.assertEqual(set(model.contacts(q, qd).state), set(range(5)))
        slopes = model.dg(q, qd, input)
        step = 1e-6
        for place, slope in enumerate(slopes):
            for j in range(len(model.coordinates)):
                ends = []
                for sign in (1, -1):
                    moved = [q.copy(), qd.copy(), input.copy()]
                    moved[place][:, j] += sign * step
                    ends.append(model.g(*moved))
                difference = (ends[0] - ends[1]) / (2 * step)
                scale = max(1.0, np.max(abs(difference)))
                np.testing.assert_allclose(slope[..., j], difference, rtol=0, atol=1e-5 * scale)

    def test_at_its_start_the_robot_rests_on_contacts_that_bear_its_weight(self):
        model = TASK.model
        free = ~np.array(model.prescribed)
        self.assertLess(np.max(abs(model.g(model.start)[free])), 1e-4)
        falling = model.g(model.start, contact=False)[model.coordinates.index("z")]
        self.assertLess(falling, -1.0)
        contacts = model.contacts(model.start)
        self.assertEqual(set(contacts.touches), {"ground"})
        mass = sum(float(part.split('"')[1]) for part in TASK.robot_text.split("<mass ")[1:])
        self.assertAlmostEqual(contacts.force_n[:, 1].sum(), 9.81 * mass, places=4)
        np.testing.assert_allclose(contacts.normal, [[0.0, 1.0]] * len(contacts.state))
        self.assertTrue(np.all(contacts.depth_m > 0))
        np.testing.assert_allclose(contacts.normal_force_n, contacts.force_n[:, 1])

    def test_states_are_broadcast_and_results_have_their_shape(self):
        model = TASK.model
        n = len(model.coordinates)
        q, qd, input = some_states(model, 6)
        got = model.g(q.reshape(2, 3, n), qd[0], input[:3])
        self.assertEqual(got.shape, (2, 3, n))
        np.testing.assert_array_equal(got[1, 2], model.g(q[5], qd[0], input[2]))
        self.assertEqual(model.dg(q.reshape(2, 3, n)).qd.shape, (2, 3, n, n))
        self.assertEqual(model.kinematics(q).velocity_m_s.shape, (6, len(model.links), 2))
        self.assertEqual(model.g(np.zeros((0, n))).shape, (0, n))
        self.assertEqual(len(model.contacts(model.start + np.eye(n)[1]).state), 0)
        transposed = np.asfortranarray(q)
        np.testing.assert_array_equal(model.g(transposed), model.g(q))

    def test_kinematics_moves_frames_at_the_velocities_that_it_says(self):
        model = TASK.model
        q, qd, _ = some_states(model, 4)
        q[:, 2] += 100.0  # Whole turns are kept.
        now, step = model.kinematics(q, qd), 1e-6
        later, before = model.kinematics(q + step * qd), model.kinematics(q - step * qd)
        np.testing.assert_allclose((later.position_m - before.position_m) / (2 * step), now.velocity_m_s, atol=1e-7)
        np.testing.assert_allclose((later.pitch_rad - before.pitch_rad) / (2 * step), now.pitch_rate_rad_s, atol=1e-6)
        root = model.links.index(model.links[0])
        np.testing.assert_array_equal(now.position_m[:, root], q[:, :2])
        np.testing.assert_array_equal(now.pitch_rad[:, root], q[:, 2])

    def test_what_is_no_state_is_refused_by_name(self):
        model = TASK.model
        for arguments, message in (
            ((model.start[:-1],), r"q: has the shape \(4,\); allowed: any whose last dimension is 5, for x, z"),
            ((model.start, np.full(5, np.nan)), "qd: has nan for x; allowed: finite"),
            ((model.start, None, [0, 0, 0, 0, np.inf]), "input: has inf for leg2"),
            ((1.0,), "q: has the shape"),
            ((np.zeros((2, 5)), np.zeros((3, 5))), "broadcast"),
        ):
            with self.assertRaisesRegex(ValueError, message):
                model.g(*arguments)


SPACE_TASK = tumbler.Task.load(support.PRIMITIVES / "solo8/tasks/walk.toml")
# As above.
SPACE_PLAIN = SPACE_TASK.replace({"limits.rotor_inertia_kg_m2": None})
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


def some_quaternions(count, seed=5):
    given = np.random.default_rng(seed).normal(size=(count, 4))
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def rotation_of(quaternion):
    w, x, y, z = quaternion
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


class InSpace(support.WithFolder):
    def test_g_and_dg_in_the_air_are_those_of_tumbler_model(self):
        model = SPACE_PLAIN.model
        given, n = np.array(model.prescribed), len(model.coordinates)
        self.assertEqual(model.coordinates[:6], ("x", "y", "z", "pitch", "roll", "yaw"))
        q, qd, input = some_states(model, 10)
        input[:, ~given] = 0
        names = [name for name, prescribed in zip(model.coordinates, model.prescribed) if prescribed]
        states = "\n".join(" ".join(f"{x:.17g}" for x in (*a, *b, *c[given])) for a, b, c in zip(q, qd, input))
        command = [self.programs / "tumbler", "model", "hybrid", SPACE_TASK.robot_file, "--root", "floating"]
        command += ["--derivatives", "--prescribed", ",".join(names)]
        done = subprocess.run(command, input=states + "\n", capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        expected = np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])
        order = [*np.flatnonzero(~given), *np.flatnonzero(given)]
        got = model.g(q, qd, input, quaternion=UPRIGHT, contact=False)[:, order]
        np.testing.assert_allclose(got, expected[:, :n], rtol=1e-8, atol=1e-8)
        blocks = expected[:, n:].reshape(len(q), 3, n, n)
        for place, matrix in enumerate(model.dg(q, qd, input, quaternion=UPRIGHT, contact=False)):
            scale = np.maximum(1, np.max(abs(blocks[:, place])))
            np.testing.assert_allclose(matrix[:, order], blocks[:, place], rtol=1e-7, atol=1e-8 * scale)

    def test_dg_is_the_slope_of_g_on_the_ground(self):
        model = SPACE_TASK.model
        q, qd, input = some_states(model, 3, seed=2)
        q = model.start + 0.001 * q
        self.assertEqual(set(model.contacts(q, qd).state), set(range(3)))
        slopes = model.dg(q, qd, input)
        step = 1e-6
        for place, slope in enumerate(slopes):
            for j in range(len(model.coordinates)):
                ends = []
                for sign in (1, -1):
                    moved = [q.copy(), qd.copy(), input.copy()]
                    moved[place][:, j] += sign * step
                    ends.append(model.g(*moved))
                difference = (ends[0] - ends[1]) / (2 * step)
                scale = max(1.0, np.max(abs(difference)))
                np.testing.assert_allclose(slope[..., j], difference, rtol=0, atol=1e-4 * scale)

    def test_at_its_start_the_robot_rests_on_contacts_that_bear_its_weight(self):
        model = SPACE_TASK.model
        free = ~np.array(model.prescribed)
        self.assertLess(np.max(abs(model.g(model.start)[free])), 1e-4)
        contacts = model.contacts(model.start)
        self.assertEqual(len(contacts.state), 4)
        mass = sum(float(part.split('"')[1]) for part in SPACE_TASK.robot_text.split("<mass ")[1:])
        self.assertAlmostEqual(model.mass_kg, mass, places=9)
        self.assertAlmostEqual(contacts.force_n[:, 2].sum(), 9.81 * mass, places=3)
        np.testing.assert_allclose(contacts.normal, [[0.0, 0.0, 1.0]] * 4)

    def test_kinematics_moves_frames_at_the_velocities_that_it_says(self):
        model = SPACE_TASK.model
        q, qd, _ = some_states(model, 4)
        q[:, 3:6] *= 0.3
        turned = some_quaternions(4)
        now, step = model.kinematics(q, qd, quaternion=turned), 1e-6
        later = model.kinematics(q + step * qd, qd, quaternion=turned)
        before = model.kinematics(q - step * qd, qd, quaternion=turned)
        np.testing.assert_allclose((later.position_m - before.position_m) / (2 * step), now.velocity_m_s, atol=1e-7)
        for state in range(4):
            for link in range(len(model.links)):
                R = rotation_of(now.quaternion[state, link])
                slope = (rotation_of(later.quaternion[state, link]) - rotation_of(before.quaternion[state, link])) / (2 * step)
                W = slope @ R.T
                w = now.angular_velocity_rad_s[state, link]
                np.testing.assert_allclose([W[2, 1], W[0, 2], W[1, 0]], w, atol=1e-6)
        # Where its angles are 0 the root is turned as the quaternion says, and by its rates about -y, x, z of its own.
        q[:, 3:6] = 0
        now = model.kinematics(q, qd, quaternion=turned)
        for state in range(4):
            R = rotation_of(turned[state])
            np.testing.assert_allclose(rotation_of(now.quaternion[state, 0]), R, atol=1e-12)
            own = np.array([qd[state, 4], -qd[state, 3], qd[state, 5]])
            np.testing.assert_allclose(now.angular_velocity_rad_s[state, 0], R @ own, atol=1e-12)

    def test_states_and_quaternions_are_broadcast(self):
        model = SPACE_TASK.model
        n = len(model.coordinates)
        q, qd, input = some_states(model, 6)
        turned = some_quaternions(3)
        got = model.g(q.reshape(2, 3, n), qd[0], input[:3], quaternion=turned)
        self.assertEqual(got.shape, (2, 3, n))
        np.testing.assert_array_equal(got[1, 2], model.g(q[5], qd[0], input[2], quaternion=turned[2]))
        self.assertEqual(model.g(q[0], quaternion=turned).shape, (3, n))
        np.testing.assert_array_equal(model.g(q[0]), model.g(q[0], quaternion=model.start_quaternion))
        self.assertEqual(model, pickle.loads(pickle.dumps(model)))

    def test_what_is_no_state_is_refused_by_name(self):
        model = SPACE_TASK.model
        for quaternion, message in (
            ([1.0, 0.0, 0.0], r"quaternion: has the shape \(3,\); allowed: any whose last dimension is 4, for w, x"),
            ([1.0, 1.0, 0.0, 0.0], "quaternion: has the length 1.41421; allowed: a unit quaternion"),
            ([np.nan, 0.0, 0.0, 0.0], "quaternion: has nan for w"),
        ):
            with self.assertRaisesRegex(ValueError, message):
                model.g(model.start, quaternion=quaternion)


if __name__ == "__main__":
    support.main(sys.argv)

"""The equations of motion in Python, against tumbler model's in space and against differences."""

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


if __name__ == "__main__":
    support.main(sys.argv)

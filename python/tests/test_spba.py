"""The package as it is installed: a scene small enough to be solved in a second, and what a host may do wrong."""

import threading
import time
import unittest

import numpy as np

import spba

OPTIONS = "threads = 2\n[solver]\nlevels = 1\n[init.hypotheses]\ncount = 2\n"
POINTS = 600


def prior():
    """Balls whose one style stretches them along z."""
    index = np.arange(POINTS)
    # A bit-reversed index puts an even sample into any first part.
    reversed_index = sum(((index >> b) & 1) << (9 - b) for b in range(10))
    height = 1.0 - 2.0 * (reversed_index + 0.5) / 1024.0
    around = 2.399963229728653 * index
    flat = np.sqrt(1.0 - height**2)
    normals = np.stack([flat * np.cos(around), height, flat * np.sin(around)], axis=1)
    mean = 0.5 / np.sqrt(3.0) * normals
    basis = np.zeros((POINTS, 3, 1))
    basis[:, 2, 0] = 0.1 * mean[:, 2]
    return spba.Prior.linear(mean, basis, normals)


def frame(index):
    y, x = np.mgrid[0:72, 0:96] + 0.5
    dx, dy = x - 48.0 - 2.0 * index, y - 36.0
    mask = dx**2 + dy**2 < 225.0
    channels = [np.where(mask, 128.0 + 60.0 * np.sin(0.5 * dx + c) * np.cos(0.4 * dy), 30.0) for c in range(3)]
    return np.stack(channels, axis=2).astype(np.uint8), mask


def sequence(frames=3, mask=lambda mask: mask):
    made = spba.Sequence()
    for index in range(frames):
        image, inside = frame(index)
        made.add(f"frame{index}", image, mask(inside), [100.0, 100.0, 48.0, 36.0])
    return made


class Solve(unittest.TestCase):
    def test_a_ball_is_found_and_again_the_same(self):
        first, second = (spba.solve(sequence(), prior(), OPTIONS) for _ in range(2))
        self.assertGreater(first.silhouette_iou.min(), 0.9)
        self.assertEqual(first.cam_from_object, second.cam_from_object)
        np.testing.assert_array_equal(first.points, second.points)
        self.assertEqual(first.points.shape, (POINTS, 3))
        self.assertLess(first.faces.max(), POINTS)
        self.assertIsNone(first.object_from_world)

    def test_masks_of_numbers_are_those_of_bool(self):
        of_bool = spba.solve(sequence(), prior(), OPTIONS)
        for kind in (lambda m: m.astype(np.uint8) * 255, lambda m: m.astype(np.float32)):
            self.assertEqual(spba.solve(sequence(mask=kind), prior(), OPTIONS).objective, of_bool.objective)

    def test_the_prior_can_be_evaluated(self):
        points, jacobian = prior().evaluate(np.array([2.0]), 10)
        still, _ = prior().evaluate(np.array([0.0]), 10)
        np.testing.assert_allclose(points, still + 2.0 * jacobian[:, :, 0], atol=1e-12)

    def test_other_threads_run_meanwhile(self):
        counted, done = [0], threading.Event()

        def count():
            while not done.is_set():
                counted[0] += 1
                time.sleep(0.001)

        counter = threading.Thread(target=count)
        counter.start()
        spba.solve(sequence(), prior(), OPTIONS)
        done.set()
        counter.join()
        self.assertGreater(counted[0], 10)


class Callbacks(unittest.TestCase):
    def test_an_observer_sees_and_stops(self):
        seen = []
        solution = spba.solve(
            sequence(), prior(), OPTIONS, lambda told: seen.append(told) or not told["stage"].startswith("level")
        )
        self.assertEqual(solution.status, "stopped")
        self.assertEqual(seen[0]["stage"], "initialise")
        with self.assertRaisesRegex(spba.SpbaError, "stopped"):
            spba.solve(sequence(), prior(), OPTIONS, lambda told: False)

    def test_what_they_raise_is_raised(self):
        def fails(*_):
            raise KeyError("mine")

        for callbacks in ({"observer": fails}, {"log": fails}):
            with self.assertRaisesRegex(KeyError, "mine"):
                spba.solve(sequence(), prior(), OPTIONS, **callbacks)

    def test_a_log_is_told(self):
        told = []
        spba.solve(sequence(), prior(), OPTIONS, log=lambda level, message: told.append(level))
        self.assertIn("info", told)


class Mistakes(unittest.TestCase):
    def test_frames(self):
        image, mask = frame(0)
        camera = [100.0, 100.0, 48.0, 36.0]
        nan = float("nan")
        for words, arguments in [
            ("frames.0. `a`.mask: it is empty", (image, mask & False, camera)),
            ("quaternion_wxyz: its norm is NaN", (image, mask, camera, ([nan, 0, 0, 0], [0, 0, 0]))),
            ("quaternion_wxyz: its norm is 0", (image, mask, camera, ([0, 0, 0, 0], [0, 0, 0]))),
        ]:
            with self.assertRaisesRegex(spba.SpbaError, words):
                spba.Sequence().add("a", *arguments)
        with self.assertRaisesRegex(TypeError, "image: give a numpy array"):
            spba.Sequence().add("a", "picture.png", mask, camera)
        with self.assertRaisesRegex(ValueError, "ascontiguousarray"):
            spba.Sequence().add("a", image[:, ::2], mask, camera)
        with self.assertRaisesRegex(spba.SpbaError, "frames: 1 left"):
            spba.solve(sequence(1), prior())

    def test_options_and_priors(self):
        with self.assertRaisesRegex(spba.SpbaError, "objektive"):
            spba.solve(sequence(), prior(), "[objektive]\n")
        with self.assertRaisesRegex(spba.SpbaError, "/no/such"):
            spba.Prior.load("/no/such")


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: Apache-2.0
import os

import numpy as np
import pytest

import helicarm

SIZE = 512


@pytest.fixture(scope="session", autouse=True)
def user_cache(tmp_path_factory):
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("case")
    truth = helicarm.simulate_case(folder, seed=3, size=SIZE)
    return folder, truth


@pytest.fixture(scope="session")
def stages():
    return []


@pytest.fixture(scope="session")
def result(case, stages):
    return helicarm.run_case(case[0], progress=stages.append)


class Pair:
    """Two exact pinhole views about the built-in calibrator: non-square images of 640 x 480 pixels."""

    def __init__(self):
        self.xyz = helicarm.Calibrator.udcsc().xyz_mm
        self.k = np.array([[2500.0, 0, 330], [0, 2480, 215], [0, 0, 1]])
        centre = self.xyz.mean(axis=0)
        self.pose = {}
        for name, forward in (("AP", np.array([0.1, 1.0, 0.05])), ("LAT", np.array([1.0, -0.1, 0.1]))):
            z = forward / np.linalg.norm(forward)
            x = np.cross([0, 0, 1.0], z)
            x /= np.linalg.norm(x)
            rotation = np.array([x, np.cross(z, x), z])
            self.pose[name] = rotation, -rotation @ (centre - 800 * z)

    def pixels(self, name, xyz):
        rotation, t = self.pose[name]
        p = (np.atleast_2d(xyz) @ rotation.T + t) @ self.k.T
        return p[:, :2] / p[:, 2:]

    def calibration(self, noise=0.0, sigma=0.1, seed=0):
        random = np.random.default_rng(seed)
        views = []
        for name in self.pose:
            uv = self.pixels(name, self.xyz)
            views.append(helicarm.ViewPoints(name, self.xyz, uv + noise * random.standard_normal(uv.shape),
                                             sigma_px=sigma))
        return helicarm.calibrate(views, rejection_probability=0)


@pytest.fixture(scope="session")
def pair():
    return Pair()

"""Inputs of the benchmarks: random SPD matrices, and domains of a human arm and a Panda."""

import numpy as np
from numpy.typing import NDArray

import maniport as mp
from maniport.arms import Arm
from maniport.transfer.rigid_adapter import recenter

Array = NDArray[np.float64]

DAMPING = 0.01


def spd_matrices(n: int, d: int, seed: int, spread: float = 1.0) -> Array:
    """SPD matrices whose logarithms are Gaussian, shape (n, d, d)."""
    gaussian = np.random.default_rng(seed).normal(size=(n, d, d)) * spread
    values, vectors = np.linalg.eigh((gaussian + np.swapaxes(gaussian, 1, 2)) / 2.0)
    product = (vectors * np.exp(values)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    return (product + np.swapaxes(product, 1, 2)) / 2.0


def ill_conditioned(n: int, d: int, seed: int, condition: float) -> Array:
    """SPD matrices in random frames, log-uniform eigenvalues, the extreme ones `condition` apart, shape (n, d, d)."""
    random = np.random.default_rng(seed)
    frames, _ = np.linalg.qr(random.normal(size=(n, d, d)))
    exponents = random.uniform(-0.5, 0.5, size=(n, d))
    exponents[:, 0] = -0.5
    exponents[:, -1] = 0.5
    product = (frames * condition ** exponents[:, None, :]) @ np.swapaxes(frames, 1, 2)
    return (product + np.swapaxes(product, 1, 2)) / 2.0


def load(name: str) -> Arm:
    """Load an arm by name; the Panda with its flange as end effector."""
    return mp.load_arm(name, frame="panda_link8" if name == "panda" else None)


def domains(n: int) -> tuple[Array, Array]:
    """Random domains of the paper's human arm and of the Panda, shapes (n, 3, 3); singular ellipsoids among them."""
    human = load("rhuman")
    panda = load("panda")
    return (
        mp.sample_domain(human, n, random_state=0, sequence="uniform"),
        mp.sample_domain(panda, n, random_state=1, sequence="uniform"),
    )


def damped(points: Array) -> Array:
    """Return M + ε I with ε = 0.01 tr(mean M) / d."""
    d = points.shape[-1]
    return points + DAMPING * np.trace(points.mean(axis=0)) / d * np.eye(d)


def recentred_domains(n: int) -> tuple[Array, Array]:
    """Return both domains about the identity and with the student's dispersion, as in the matching step of ICP."""
    teacher, student = (damped(domain) for domain in domains(n))
    mean_t = mp.spd.mean(teacher)
    mean_s = mp.spd.mean(student)
    ratio = mp.spd.dispersion(student, mean_s) / mp.spd.dispersion(teacher, mean_t)
    return recenter(teacher, mean_t, ratio), recenter(student, mean_s)

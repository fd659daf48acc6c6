"""Registration of other SPD data: covariances of two sessions, stiffness and inertia.

A classifier of covariance matrices is used in another session, in which all matrices are moved, stretched and rotated.
TLCenter, TLScale and TLRotate of pyRiemann stand beside adapters; only TLRotate needs classes of the new session. Then
stiffness and inertia matrices in an unknown frame are mapped back.

    python 13_other_spd_data.py
"""

import numpy as np
from pyriemann.classification import MDM
from pyriemann.datasets import make_classification_transfer
from pyriemann.transfer import TLCenter, TLClassifier, TLRotate, TLScale, decode_domains
from sklearn.pipeline import make_pipeline

import maniport as mp

OLD, NEW = "source_domain", "target_domain"
SESSIONS = {"class_sep": 2.0, "class_disp": 0.6, "domain_sep": 5.0, "theta": 0.6, "stretch": 1.5}
ADAPTERS = (mp.ParallelTransport(), mp.ScaledTransport(), mp.RiemannianICP())


def accuracies(seed):
    """Return the share of right classes of the new session's second half, by method."""
    matrices, labels = make_classification_transfer(100, **SESSIONS, random_state=seed)
    _, classes, domains = decode_domains(matrices, labels)
    new = np.flatnonzero(domains == NEW)
    test = new[1::2]
    train = np.setdiff1d(np.arange(len(matrices)), test)
    old = np.flatnonzero(domains == OLD)
    plain = MDM().fit(matrices[old], classes[old])
    result = {"as it is": np.mean(plain.predict(matrices[test]) == classes[test])}

    steps = (TLCenter(NEW), TLScale(NEW, centered_data=True), TLRotate(NEW))
    for count, name in ((1, "TLCenter"), (2, "TLCenter, TLScale"), (3, "… TLRotate, classes")):
        classifier = TLClassifier(NEW, MDM(), domain_weight={OLD: 1.0, NEW: 0.0})
        pipeline = make_pipeline(*steps[:count], classifier).fit(matrices[train], labels[train])
        result[name] = np.mean(pipeline.predict(matrices[test]) == classes[test])

    for adapter in ADAPTERS:
        adapter.fit(matrices[np.setdiff1d(new, test)], matrices[old])
        mapped = adapter.transform(matrices[test])
        result[type(adapter).__name__] = np.mean(plain.predict(mapped) == classes[test])
    return result


def largest_error(matrices, seed):
    """Map matrices from an unknown frame back; return the largest distance to the matrices themselves."""
    rng = np.random.default_rng(seed)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame[0] *= np.linalg.det(frame)
    seen = frame @ matrices @ frame.T
    adapter = mp.RiemannianICP().fit(rng.permutation(seen), matrices)
    return mp.spd.distance(adapter.transform(seen), matrices).max()


def main(_folder=None):
    """Compare accuracies, then recover the frame of stiffness and inertia matrices."""
    draws = [accuracies(seed) for seed in range(5)]
    mean = {name: float(np.mean([draw[name] for draw in draws])) for name in draws[0]}
    for name, value in mean.items():
        print(f"{name:22} {100 * value:.0f} %")
    arm = mp.load_arm("panda")
    jacobians = arm.jacobian(arm.sample(80, 0))[:, :3]
    stiffness = np.linalg.inv(jacobians @ np.swapaxes(jacobians, 1, 2) / 500.0)  # [N/m]
    rng = np.random.default_rng(0)
    masses = rng.normal(size=(80, 30, 3)) * rng.uniform(0.1, 0.5, size=(80, 1, 3))  # of 1 kg [m]
    moments = np.swapaxes(masses, 1, 2) @ masses
    inertia = np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moments  # [kg m²]
    errors = {"stiffness": largest_error(stiffness, 0), "inertia": largest_error(inertia, 1)}
    print(", ".join(f"{name}: largest error {error:.0e}" for name, error in errors.items()))
    return mean, errors


if __name__ == "__main__":
    main()

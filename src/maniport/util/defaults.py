"""What is taken where nothing is said, for library and command line alike; light, since every start loads it."""

DAMPING = 0.01  # ρ of the damping: the longest axes feel nothing of it, and flat ellipsoids lie at a finite distance

AUTO = "auto"
"""Name for the length field if it passes its checks, else parallel transport; see `maniport.evaluation.choose`."""

BOTH = "both"  # side of a person with both arms

KEEP = "keep"  # Said of leaps of a recording: they stay, and are told

PERSON, ROBOT, METHOD = "myoarm", "panda", AUTO
"""Models of the person's arm and of the robot, and how domains are mapped."""

TEACHER_SAMPLES, STUDENT_SAMPLES = 4096, 16384  # Sizes of the sampled domains; they suffice for arms of seven joints

EFFORT = "full"  # How much is tried for a motion, see `maniport.motion.effort`

BATCH_METHOD = "length-field"
"""How domains are mapped in a batch, which takes one method for all: to choose for each recording takes seconds."""

BATCH_EFFORT = "quick"  # The same for each motion of a batch

BATCH_PROFILE_RATE = 10.0
"""Ellipsoids a second that a batch transfers and follows [Hz]; between them motions are smooth."""

BATCH_RATE = 100.0  # Samples of a motion a second in a batch [Hz]: rows to learn from, rather than for a controller

FIT_METHOD = "icp"
"""How domains are mapped where neither a motion nor a robot is known, so that nothing can be chosen by."""

POSITION_TOLERANCE = 5e-3  # How far beside its path the tip of a planned motion may be [m]
MARGIN = 0.02  # Share of a joint's range that is kept free at either end
RATE = 1000.0  # Samples of a planned motion a second [Hz]

RECORDINGS = {
    ".bvh": "bvh", ".c3d": "c3d", ".trc": "trc", ".mot": "mot", ".sto": "mot", ".mvnx": "mvnx",
    ".npz": "npz", ".npy": "npz", ".csv": "table", ".tsv": "table", ".json": "keypoints",
}  # fmt: skip
"""Endings of recordings that are read, and the module of `maniport.mocap.readers` that reads each."""

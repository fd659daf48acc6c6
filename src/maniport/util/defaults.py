"""Defaults that several packages share; light, since the command line loads it at each start."""

AUTO = "auto"
"""Word for a choice by the program; as a method: the length field if it passes its checks, else a transport."""

UNKNOWN = "unknown"  # base rotation that the method has to estimate

BOTH = "both"  # side of a person with both arms

# human arm model and robot
PERSON = "myoarm"
ROBOT = "panda"
DAMPING = 0.01  # relative damping ρ: hardly changes long axes, and singular ellipsoids get finite distances
# sizes of the sampled domains, sufficient for arms of seven joints
TEACHER_SAMPLES = 4096
STUDENT_SAMPLES = 16384

POSITION_TOLERANCE = 5e-3  # position tolerance of the end effector [m]
MARGIN = 0.02  # share of a joint's range that is kept free at either end
RATE = 1000.0  # sampling rate of a planned motion [Hz]

RECORDINGS = {
    ".bvh": "bvh",
    ".c3d": "c3d",
    ".trc": "table",
    ".mot": "mot",
    ".sto": "mot",
    ".mvnx": "mvnx",
    ".npz": "npz",
    ".npy": "npz",
    ".csv": "table",
    ".tsv": "table",
    ".json": "keypoints",
    ".zip": "archive",
}
"""Suffixes of recordings, and the module of `maniport.mocap.readers` that reads each."""

SHIPPED = {"ladder": "ladder.bvh", "freeform": "freeform.c3d", "both-arms": "both_arms.c3d"}
"""``"ladder"``: a person climbs a ladder and hangs from it (BVH). ``"freeform"``: free motion of the right arm (C3D).
``"both-arms"``: the same motion with the left arm, which moves more."""

ABOUT = "batch.json"  # the file that marks a folder as that of a batch

METHODS = {
    "identity": "baselines:IdentityMap",
    "mean-transport": "rigid_adapter:MeanTransport",
    "parallel-transport": "rigid_adapter:ParallelTransport",
    "scaled-transport": "rigid_adapter:ScaledTransport",
    "nearest-neighbor": "baselines:NearestNeighbor",
    "icp": "icp:RiemannianICP",
    "length-field": "length_field:LengthField",
}
"""Transfer methods, cheapest first: the module of `maniport.transfer` and the class of each."""

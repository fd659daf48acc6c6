from collections.abc import Callable
from typing import Any

from maniport import arms as arms
from maniport import batch as batch
from maniport import domain as domain
from maniport import errors as errors
from maniport import evaluation as evaluation
from maniport import learning as learning
from maniport import live as live
from maniport import mocap as mocap
from maniport import motion as motion
from maniport import pipeline as pipeline
from maniport import report as report
from maniport import spd as spd
from maniport import transfer as transfer
from maniport.arms import Arm as Arm
from maniport.arms import ArmGroup as ArmGroup
from maniport.arms import EllipsoidSpec as EllipsoidSpec
from maniport.arms import load_arm as load_arm
from maniport.arms import load_arms as load_arms
from maniport.arms.collisions import Collisions as Collisions
from maniport.batch import transfer_batch as transfer_batch
from maniport.domain import sample_domain as sample_domain
from maniport.evaluation import evaluate as evaluate
from maniport.learning import ProfileGMM as ProfileGMM
from maniport.learning import align as align
from maniport.live import Live as Live
from maniport.mocap import Recording as Recording
from maniport.mocap import fit_arm as fit_arm
from maniport.mocap import fit_arms as fit_arms
from maniport.mocap import read_recording as read_recording
from maniport.motion import FeasibleProjector as FeasibleProjector
from maniport.motion import SeedBank as SeedBank
from maniport.motion import nearest_feasible as nearest_feasible
from maniport.motion import track as track
from maniport.pipeline import LearnedProfile as LearnedProfile
from maniport.pipeline import MotionResult as MotionResult
from maniport.pipeline import TransferResult as TransferResult
from maniport.pipeline import follow_profile as follow_profile
from maniport.pipeline import learn as learn
from maniport.pipeline import transfer_recording as transfer_recording
from maniport.report.console import progress as progress
from maniport.report.figures import write_figures as write_figures
from maniport.report.write import write_results as write_results
from maniport.transfer import IdentityMap as IdentityMap
from maniport.transfer import LengthField as LengthField
from maniport.transfer import MeanTransport as MeanTransport
from maniport.transfer import NearestNeighbor as NearestNeighbor
from maniport.transfer import ParallelTransport as ParallelTransport
from maniport.transfer import RiemannianICP as RiemannianICP
from maniport.transfer import load_adapter as load_adapter
from maniport.version import __version__ as __version__

def names_of_stub(package: str, file: str) -> tuple[list[str], Callable[[str], Any]]: ...

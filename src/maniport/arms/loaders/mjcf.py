"""MJCF: checks, joint equalities, several joints of one body, ranges and shapes.

Ranges are read here, since Pinocchio 4 converts those of prismatic joints from degrees. Pinocchio ignores `<include>`,
all trees of bodies but the first, and the pose of a first body that cannot move: it reads a copy with all included
files and all bodies in one tree. For shapes, each mesh of the copy is one triangle, since its native mesh reader
crashes on damaged files.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull, QhullError

from maniport.arms.chain import Mesh, Shape
from maniport.arms.loaders.document import LARGEST, Follower, RobotXML, inertia_fault
from maniport.arms.loaders.mjcf_tree import WORLD, one_tree, with_includes
from maniport.arms.meshes import SOLIDS
from maniport.arms.meshes.mesh_files import scaled
from maniport.arms.meshes.mesh_paths import MeshPaths, is_file
from maniport.errors import FileFormatError
from maniport.util.atomic_io import temporary_beside

ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion")


class Mjcf(RobotXML):
    """A robot in MuJoCo's format."""

    name, tag, bounded = "MJCF", "mujoco", ("body", "joint")

    @classmethod
    def checked(cls, path: Path, text: str, root: ElementTree.Element) -> RobotXML:
        """Check the text and the root of a file with its included files."""
        return super().checked(path, text, with_includes(path, root) if root.tag == cls.tag else root)

    def build(self) -> pin.Model:
        """Read the kinematics with Pinocchio, without shapes, actuators, sensors, cameras and lights."""
        tree = one_tree(self.root)
        tree[:] = [section for section in tree if section.tag in ("compiler", "default", "worldbody")]
        for parent in list(tree.iter()):
            parent[:] = [child for child in parent if child.tag not in ("geom", "camera", "light")]
            parent.attrib.pop("ref", None)  # Pinocchio misplaces all but the last joint of a body
        with TemporaryDirectory(prefix="maniport-") as folder:
            file = Path(folder) / self.path.with_suffix(".xml").name
            ElementTree.ElementTree(tree).write(file, encoding="utf-8")
            return pin.buildModelFromMJCF(str(file))

    def followers(self) -> Iterator[tuple[str, Follower]]:
        """Yield the joints of joint equalities; MuJoCo counts both positions from their rest values."""
        for joint in self.root.findall("equality/joint"):
            if joint.get("active", "true") == "true":
                follower, leader = joint.get("joint1", ""), joint.get("joint2")
                c = [float(x) for x in joint.get("polycoef", "0 1 0 0 0").split()] + [0.0] * 5
                offset = c[0] + self.rest_position(follower) - c[1] * self.rest_position(leader or "")
                yield follower, Follower(leader, c[1], offset, not any(c[2:]))

    @cached_property
    def _parents(self) -> dict[ElementTree.Element, ElementTree.Element]:
        return {child: parent for parent in self.root.iter() for child in parent}

    @cached_property
    def _joints(self) -> dict[str, ElementTree.Element]:
        return {name: element for joints in self.body_joints().values() for name, element in joints.items()}

    def body_joints(self) -> dict[str, dict[str, ElementTree.Element]]:
        """Return the joints of each body: body name, then joint name."""
        return {
            body.get("name", ""): {j.get("name", ""): j for j in body.findall("joint") if j.get("type") != "free"}
            for body in self.root.findall("worldbody//body")
        }

    def rest_position(self, name: str) -> float:
        """Return the `ref` of a joint [rad] or [m]."""
        joint = self._joints.get(name)
        return 0.0 if joint is None else self._numbers(joint, "ref", "0", 1)[0] * self._unit(joint)

    def joint_range(self, name: str) -> tuple[float, float]:
        """Return the range of a joint [rad] or [m], its own or that of its class; infinite without one."""
        joint = self._joints.get(name)
        if joint is None:
            return -np.inf, np.inf
        low, high = self._range(joint, "range", "limited")
        return low * self._unit(joint), high * self._unit(joint)

    def effort_limit(self, name: str) -> float:
        """Return the largest torque [N m] or force [N] of a joint and of all its actuators, in the weaker direction."""
        actuators = [a for a in self.root.findall("actuator/*") if name in (a.get("joint"), a.get("jointinparent"))]
        total = sum(map(self._actuator_limit, actuators)) if actuators else np.inf
        joint = self._joints.get(name)
        return total if joint is None else min(total, self._weaker(joint, "actuatorfrc"))

    def _actuator_limit(self, actuator: ElementTree.Element) -> float:
        """Largest torque [N m] or force [N] at the joint: by the force range, or by the controls of a plain motor."""
        gear, gain = (self._numbers(actuator, name, "1")[0] for name in ("gear", "gainprm"))
        plain = actuator.tag in ("motor", "general") and self._attribute(actuator, "biastype") in (None, "none")
        controls = abs(gain) * self._weaker(actuator, "ctrl") if plain else np.inf
        return abs(gear) * min(self._weaker(actuator, "force"), controls)

    def _weaker(self, element: ElementTree.Element, what: str) -> float:
        """Smaller absolute value of the bounds ``<what>range``; infinite without them."""
        return float(np.abs(self._range(element, f"{what}range", f"{what}limited")).min())

    def _range(self, element: ElementTree.Element, name: str, limited: str) -> tuple[float, float]:
        """Bounds of an element, its own or those of its class; infinite without them."""
        if self._attribute(element, limited) == "false":
            return -np.inf, np.inf
        low, high = self._numbers(element, name, "-inf inf", 2)
        return low, high

    def _numbers(self, element: ElementTree.Element, name: str, default: str, count: int | None = None) -> list[float]:
        text = self._attribute(element, name) or default
        try:
            numbers = [float(word) for word in text.split()]
        except ValueError:
            numbers = []
        if not numbers or len(numbers) != (count or len(numbers)):
            who = f"<{element.tag}> {element.get('name', element.get('joint'))!r}"
            raise FileFormatError(f"{self.path}: {who} has {name} {text!r}; {count or 'some'} numbers are needed")
        return numbers

    def _unit(self, joint: ElementTree.Element) -> float:
        angle = [compiler.get("angle") for compiler in self.root.findall("compiler") if compiler.get("angle")]
        hinge = self._attribute(joint, "type") in (None, "hinge")
        return np.pi / 180 if hinge and (not angle or angle[-1] == "degree") else 1.0

    def _attribute(self, element: ElementTree.Element, attribute: str) -> str | None:
        """Return an attribute of an element, its own or that of its default class; actuators share their defaults."""
        if element.get(attribute) is not None:
            return element.get(attribute)
        tags = ACTUATORS if element.tag in ACTUATORS else (element.tag,)
        name, node = element.get("class"), self._parents.get(element)
        while name is None and node is not None:
            name, node = node.get("childclass"), self._parents.get(node)
        top = self.root.find("default")
        entry = next((d for d in self.root.iter("default") if name is not None and d.get("class") == name), top)
        while entry is not None and entry.tag == "default":
            for default in reversed(entry):
                if default.tag in tags and default.get(attribute) is not None:
                    return default.get(attribute)
            entry = self._parents.get(entry)
        return None

    def fault(self) -> str:
        """Describe the first inconsistency or unsupported element; empty without one."""
        ignored = ("frame", "replicate", "attach", "composite", "flexcomp")  # by Pinocchio, with all bodies in them
        unread = sorted({tag for tag in ignored for _ in self.root.iter(tag)})
        if unread:
            return (
                f"uses <{'>, <'.join(unread)}>, which are not supported; save the model as one plain file first, for "
                "example with mujoco.MjModel.from_xml_path and mujoco.mj_saveLastXML"
            )
        if self.root.find("worldbody//body") is None:
            return "has no body in <worldbody>"
        for tag in self.bounded:
            names = Counter(element.get("name") for element in self.root.findall(f"worldbody//{tag}"))
            names[WORLD] += tag == "body"  # implicit
            for name, count in names.items():
                if name is not None and count > 1:
                    return f"{tag} {name!r} appears {count} times"
        classes = {default.get("class", "main") for default in self.root.iter("default")}
        for element in self.root.findall("worldbody//*"):
            for name in (element.get("class"), element.get("childclass")):
                if name is not None and name not in classes:
                    return f"<{element.tag}> is of the class {name!r}, which no <default> defines"
        counts = {
            "pos": 3, "quat": 4, "axis": 3, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3, "fromto": 6, "ref": 1,
            "diaginertia": 3, "fullinertia": 6, "mass": 1, "scale": 3,
        }  # fmt: skip
        for element in self.root.iter():
            for name in counts.keys() & element.keys():
                text = element.get(name, "")
                try:
                    numbers = [float(word) for word in text.split()]
                except ValueError:
                    numbers = []
                if len(numbers) != counts[name] or not all(abs(number) < LARGEST for number in numbers):
                    rule = f"{name} with {counts[name]} numbers, each below {LARGEST:g}"
                    return f"<{element.tag}> needs {rule}; found {text[:80]!r}"
                if name == "quat" and np.linalg.norm(numbers) < 1e-9:
                    return f"<{element.tag}> has quat {text[:80]!r}, which is no rotation"
        faults = (self._inertia_fault(body) for body in self.root.findall("worldbody//body"))
        return next(filter(None, faults), "")

    def _inertia_fault(self, body: ElementTree.Element) -> str:
        inertial = body.find("inertial")
        if inertial is None:
            return ""
        moments = inertial.get("fullinertia") or inertial.get("diaginertia", "0 0 0") + " 0 0 0"
        return inertia_fault(body.get("name", ""), float(inertial.get("mass", "0")), list(map(float, moments.split())))

    def unweighed(self) -> set[str]:
        """Return the bodies with masses by their shapes, which are not computed."""
        ignored = any(compiler.get("inertiafromgeom") == "true" for compiler in self.root.findall("compiler"))
        return {
            body.get("name", "") for body in self.root.findall("worldbody//body")
            if (ignored or body.find("inertial") is None) and any(map(self._has_mass, body.findall("geom")))
        }  # fmt: skip

    def _has_mass(self, geom: ElementTree.Element) -> bool:
        return all(self._numbers(geom, name, "1")[0] > 0 for name in ("mass", "density"))

    def shapes(self, links: Collection[str], paths: MeshPaths) -> Iterator[Shape]:
        """Yield the shapes of bodies: those without contacts if a body has such, else all."""
        options = {name: value for compiler in self.root.findall("compiler") for name, value in compiler.items()}
        folder = paths.path.parent / options.get("meshdir", options.get("assetdir", ""))
        meshes: dict[str, Path | ElementTree.Element] = {}  # by their placeholder: a file, or an element with points
        for i, mesh in enumerate(self.root.iterfind("asset/mesh")):
            file = mesh.get("file", "")
            file = Path(file).name if options.get("strippath") == "true" else file
            meshes[f"{i}.stl"] = folder / file if file else mesh
        model, visual, solid = self._geometries()
        touching = {thing.name for thing in solid.geometryObjects}
        dressed = {thing.parentFrame for thing in visual.geometryObjects if thing.name not in touching}
        for thing in visual.geometryObjects:
            frame = model.frames[thing.parentFrame]
            if frame.name in links and (thing.name not in touching or thing.parentFrame not in dressed):
                placement = (frame.placement.inverse() * thing.placement).homogeneous
                if (shape := _mesh(thing, paths, meshes)) is not None:
                    points, triangles = shape
                    yield Shape(frame.name, (points @ placement[:3, :3].T + placement[:3, 3], triangles))

    def _geometries(self) -> tuple[pin.Model, pin.GeometryModel, pin.GeometryModel]:
        """Return the model and its visual and collision geometry, with a triangle for each mesh."""
        root = one_tree(self.root)
        corners = np.array([0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0], "<f4")
        triangle = bytes(80) + (1).to_bytes(4, "little") + corners.tobytes() + bytes(2)  # an STL
        for compiler in root.findall("compiler"):
            for option in ("meshdir", "assetdir", "strippath"):
                compiler.attrib.pop(option, None)
        with temporary_beside(Path(gettempdir()) / "maniport", folder=True) as folder:
            for i, mesh in enumerate(root.iterfind("asset/mesh")):
                mesh.set("name", mesh.get("name") or Path(mesh.get("file", "")).stem)
                mesh.set("file", f"{i}.stl")
                for own in ("vertex", "face", "normal", "texcoord", "builtin", "params"):
                    mesh.attrib.pop(own, None)
                (folder / f"{i}.stl").write_bytes(triangle)
            file = folder / "robot.xml"
            ElementTree.ElementTree(root).write(file, encoding="utf-8")
            try:
                model = pin.buildModelFromMJCF(str(file))
                visual, solid = (pin.buildGeomFromMJCF(model, str(file), kind) for kind in (pin.VISUAL, pin.COLLISION))
            except (ValueError, RuntimeError, IndexError) as error:
                reason = " ".join(str(error).split("message:")[-1].split())
                raise FileFormatError(f"{self.path}: its shapes cannot be read: {reason}") from None
        return model, visual, solid


def _mesh(thing: pin.GeometryObject, paths: MeshPaths, meshes: Mapping[str, Path | ElementTree.Element]) -> Mesh | None:
    """Return the mesh of a shape of Coal; none for planes, which are infinite."""
    shape = thing.geometry
    if isinstance(shape, coal.BVHModelBase):
        mesh, scale = meshes[Path(thing.meshPath).name], np.asarray(thing.meshScale)
        if not isinstance(mesh, Path):
            return scaled(_own_mesh(paths.path, mesh), scale)
        if not is_file(mesh):
            files = {file for file in meshes.values() if isinstance(file, Path)}
            missing = sum(not is_file(file) for file in files)
            raise FileFormatError(
                f"{paths.path}: the mesh {str(mesh)!r} is missing ({missing} of {len(files)} meshes are)"
            )
        paths.require_allowed(mesh, str(mesh))
        return scaled(paths.mesh(mesh), scale)
    kind = type(shape).__name__.lower()
    if kind == "box":
        return SOLIDS[kind](*(2 * shape.halfSide))
    if kind in ("sphere", "ellipsoid"):
        return SOLIDS[kind](*np.atleast_1d(shape.radius if kind == "sphere" else shape.radii))
    if kind in ("cylinder", "capsule"):
        return SOLIDS[kind](shape.radius, 2 * shape.halfLength)
    if isinstance(shape, (coal.Plane, coal.Halfspace)):
        return None
    raise FileFormatError(f"{paths.path}: {thing.name!r} has an unsupported shape: {type(shape).__name__}")


def _own_mesh(path: Path, mesh: ElementTree.Element) -> Mesh:
    """Points and triangles of a mesh in an MJCF; without triangles the hull of the points."""
    try:
        points = np.array([float(word) for word in mesh.get("vertex", "").split()]).reshape(-1, 3)
        rows = np.array([int(word) for word in mesh.get("face", "").split()], dtype=np.int32).reshape(-1, 3)
        if not np.all(np.abs(points) < LARGEST) or not np.all((rows >= 0) & (rows < len(points))):
            raise ValueError("invalid numbers")
        return points, rows if len(rows) else ConvexHull(points).simplices.astype(np.int32)
    except (ValueError, OverflowError, QhullError) as error:
        reason = str(error).splitlines()[0]
        raise FileFormatError(f"{path}: the points of the mesh {mesh.get('name')!r} are no solid: {reason}") from None

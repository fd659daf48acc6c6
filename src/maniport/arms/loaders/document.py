"""Robot files as XML within the limits of inputs, their numbers and mesh files."""

import os
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from maniport.arms.chain import CollisionShapes, ContactRules, Mesh, Shape, moved_inertia
from maniport.arms.loaders.package_folders import (
    holds_home,
    is_file,
    origins,
    package_folders,
    ros_folders,
)
from maniport.arms.loaders.xacro_files import expanded
from maniport.arms.meshes.mesh_files import load_mesh, require_no_pointer
from maniport.errors import FileFormatError
from maniport.util.input_limits import (
    NESTING,
    ROBOT_BYTES,
    SHAPES,
    TAGS,
    TRIANGLES,
    read_whole,
    require_at_most,
)
from maniport.util.validation import MAX_POSITION, Array

XACRO = ".xacro"
ENCODINGS = (b"iso-8859", b"iso8859", b"latin", b"windows-125", b"cp125", b"gb", b"big5", b"euc")
"""Beginnings of the encodings that an XML file may declare, in addition to UTF-8 and UTF-16."""
LARGEST = 1e9  # upper bound of all numbers of a robot


def require(rule: bool, path: str | os.PathLike[str], fault: str) -> None:
    """Raise `FileFormatError` with a fault of a file unless a rule holds."""
    if not rule:
        raise FileFormatError(f"{path}: {fault}")


def numbers(
    text: str | None, count: int | None, where: str, most: float = LARGEST, least: float = -np.inf
) -> Array:
    """Read the numbers of an attribute, each at least `least` and at most `most` in absolute value.

    `where` names the file, the element and the attribute, for messages.
    """
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.empty(0)
    expected = len(values) > 0 and len(values) == (count or len(values))
    if not expected or not np.all((np.abs(values) <= most) & (values >= least)):
        rule = f"{count or 'several'} number{'s' * (count != 1)}{f', each below {most:g}' * bool(most < np.inf)}"
        if least == 0.0:
            sign = " and not negative"
        else:
            sign = ""
        raise FileFormatError(
            f"{where} with {rule}{sign}; found {None if text is None else text[:80]!r}"
        )
    return values


def body_inertia(where: str, mass: float, moments: Sequence[float], pose: Array) -> Array:
    """Spatial inertia (6, 6) of a mass [kg] and moments of inertia xx, yy, zz, xy, xz, yz [kg m²] at a pose (4, 4)."""
    matrix = np.array(moments)[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
    least = float(np.linalg.eigvalsh(matrix)[0])
    if least < -1e-6:  # small negative moments are common rounding errors of small links
        raise FileFormatError(
            f"{where} has the moment of inertia {least:.3g} kg m² about an axis; it must not be negative"
        )
    inertia = np.diag([mass, mass, mass, 0.0, 0.0, 0.0])
    inertia[3:, 3:] = matrix
    return moved_inertia(inertia, pose)


@dataclass(frozen=True, eq=False)
class Declared:
    """A shape of a link as its file declares it; its mesh is read when the shape is made.

    Attributes
    ----------
    link : str
    collision : bool
        Whether it is declared for collisions.
    make : callable
        Makes the shape; raises `FileFormatError` for a faulty one, or one whose mesh cannot be read.
    available : callable
        Whether its mesh file exists, if it has one.
    hidden : bool
        Whether it is drawn only where the link has no other shape.
    infinite : bool
        Whether it is an infinite plane, which is never drawn.
    """

    link: str
    collision: bool
    make: Callable[[], Shape]
    available: Callable[[], bool]
    hidden: bool = False
    infinite: bool = False


ShapeReader = Callable[
    [Path, ElementTree.Element, Collection[str], "MeshPaths"],
    tuple[list[Declared], ContactRules | None],
]
"""Lists all shapes of some links of a document, and the contacts that it excludes."""


def read_shapes(
    read: ShapeReader,
    path: Path,
    links: Collection[str],
    mesh_folders: Sequence[Path] = (),
    xacro_args: Mapping[str, str] | None = None,
) -> list[Shape]:
    """Read the shapes of some links to draw them; meshes of other links may be missing.

    These are the visual shapes, or else the collision shapes of links without any, or with a mesh that cannot be read.
    """
    by_link, _ = _declared(read, path, links, mesh_folders, xacro_args)
    chosen: list[Shape] = []
    for listed in by_link.values():
        visual = _drawn(listed)
        shapes, fault = _made(path, visual)
        if fault:
            contacts = [shape for shape in listed if shape.collision and shape not in visual]
            shapes, other_fault = _made(path, contacts)
            if not shapes or other_fault:
                raise FileFormatError(fault)
            shapes = [replace(shape, stand_in=True) for shape in shapes]
        chosen += shapes
        _require_few(path, chosen)
    return chosen


def read_collision_shapes(
    read: ShapeReader,
    path: Path,
    links: Collection[str],
    mesh_folders: Sequence[Path] = (),
    xacro_args: Mapping[str, str] | None = None,
) -> CollisionShapes:
    """Read the shapes of some links to check them for collisions.

    These are the collision shapes. A link without any, or with one that cannot be read, has its visual shapes; if these
    cannot be read either, those shapes that can.
    """
    by_link, rules = _declared(read, path, links, mesh_folders, xacro_args)
    chosen: list[Shape] = []
    missing: dict[str, str] = {}
    replaced: dict[str, str] = {}
    undrawn: list[str] = []
    for link, listed in by_link.items():
        contacts = [shape for shape in listed if shape.collision]
        visual = [shape for shape in _drawn(listed) if not shape.collision]
        shapes, fault = _made(path, contacts)
        if not contacts or fault:
            drawn, drawn_fault = _made(path, visual)
            if drawn and not drawn_fault:
                shapes = drawn
                if fault:
                    replaced[link] = fault
            elif fault or drawn_fault:
                shapes = shapes or drawn
                missing[link] = fault or drawn_fault
        elif not _are_available(visual):
            undrawn.append(link)
        chosen += shapes
        _require_few(path, chosen)
    return CollisionShapes(chosen, missing, replaced, tuple(undrawn), rules)


def _declared(
    read: ShapeReader,
    path: Path,
    links: Collection[str],
    mesh_folders: Sequence[Path],
    xacro_args: Mapping[str, str] | None,
) -> tuple[dict[str, list[Declared]], ContactRules | None]:
    """List the declared shapes of each link, and the contacts that the document excludes."""
    root = parsed(path, mesh_folders, xacro_args)
    declared, rules = read(path, root, links, MeshPaths(path, mesh_folders))
    require_at_most(len(declared), SHAPES, "shapes", path)
    by_link: dict[str, list[Declared]] = {}
    for shape in declared:
        by_link.setdefault(shape.link, []).append(shape)
    return by_link, rules


def _are_available(shapes: Sequence[Declared]) -> bool:
    return all(shape.available() for shape in shapes)


def _require_few(path: Path, shapes: Sequence[Shape]) -> None:
    triangles = sum(len(shape.mesh[1]) for shape in shapes)
    require_at_most(triangles, TRIANGLES, "triangles in its shapes", path)


def _drawn(listed: Sequence[Declared]) -> list[Declared]:
    """Shapes of a link that are drawn: visual ones, else those that are not hidden, else all."""
    finite = [shape for shape in listed if not shape.infinite]
    visual = [shape for shape in finite if not shape.collision]
    if visual:
        return visual
    return [shape for shape in finite if not shape.hidden] or finite


def _made(path: Path, declared: Sequence[Declared]) -> tuple[list[Shape], str]:
    """Make the shapes that can be made; the text is the first fault of another."""
    shapes = []
    fault = ""
    for declared_shape in declared:
        try:
            shape = declared_shape.make()
            if not np.all(np.abs(shape.mesh[0]) < MAX_POSITION):  # false for nan, too
                raise FileFormatError(
                    f"{path}: a shape of link {declared_shape.link!r} reaches farther than {MAX_POSITION:g} m"
                )
        except FileFormatError as error:
            fault = fault or str(error)
            continue
        shapes.append(shape)
    return shapes, fault


def parsed(
    path: Path, folders: Sequence[Path] = (), xacro_args: Mapping[str, str] | None = None
) -> ElementTree.Element:
    """Read the root of an XML file within the input limits.

    A xacro file is expanded with its arguments; `folders` are searched for packages in addition.
    """
    try:
        content = _decoded(path, read_whole(path, (), ROBOT_BYTES))
        if path.suffix.lower() == XACRO:
            text = expanded(path, folders, {} if xacro_args is None else xacro_args)
        else:
            text = content
        require_at_most(text.count("<"), TAGS, "tags", path)
        # prefixes need no declaration
        builder = ElementTree.TreeBuilder()
        parser = expat.ParserCreate()
        parser.StartElementHandler = builder.start
        parser.EndElementHandler = builder.end
        parser.Parse(text, True)
        root = builder.close()
    except expat.ExpatError as error:
        raise FileFormatError(f"{path}: not readable as XML, perhaps cut off: {error}") from None
    level = [root]
    depth = 0
    while level:
        children = list[ElementTree.Element]()
        for element in level:
            children += element
        level = children
        depth = depth + 1
    require_at_most(depth, NESTING, "levels of elements within elements", path)
    return root


def _decoded(path: Path, content: bytes) -> str:
    """Return the text of an XML file: UTF-8, or else UTF-16 or the encoding that it declares."""
    require_no_pointer(path, content)
    try:
        return content.decode("utf-8").lstrip("\ufeff")
    except UnicodeDecodeError as error:
        fault = f"{error.reason} at byte {error.start}"
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        encoding = "utf-16"
    else:
        encoding = None
    declared = re.match(rb"<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']", content)
    if declared is not None and declared[1].lower().startswith(ENCODINGS):
        encoding = declared[1].decode()
    if encoding is not None:
        try:
            return content.decode(encoding).lstrip("\ufeff")
        except (UnicodeError, LookupError) as error:
            fault = f"it cannot be decoded as {encoding}: {error}"
    raise FileFormatError(f"{path}: not a text file: {fault}")


@dataclass(frozen=True)
class MeshPaths:
    """Mesh files by their names in a robot file.

    Robot files are not trusted. Meshes must be in the folder of the file, its parent (``urdf/`` next to ``meshes/``),
    its package, a named package near it, a package of ROS, or a folder that the user allows.
    """

    path: Path  # the robot's file
    more: Sequence[Path] = ()  # folders that the user allows, also searched for packages
    read: dict[Path, Mesh | FileFormatError] = field(default_factory=dict)  # cache
    found: dict[str, Path | str | None] = field(default_factory=dict)  # cache of `find`
    packages: dict[str, list[Path]] = field(default_factory=dict)  # cache of their folders, by name

    def mesh(self, file: Path) -> Mesh:
        """Read a mesh file once; a file that cannot be read has the same error each time."""
        if file not in self.read:
            try:
                self.read[file] = load_mesh(file)
            except FileFormatError as error:
                self.read[file] = error
        content = self.read[file]
        if isinstance(content, FileFormatError):
            raise FileFormatError(str(content))
        return content

    def find(self, name: str) -> Path | None:
        """Return the file of a mesh name; None if it is missing, an error if it is not allowed.

        Names are relative to the folder of the robot file. Ends of an absolute name, perhaps from another machine, are
        searched in the folders of the robot file, and ends of every name in the folders that the user allows: of
        ``/home/me/kit/meshes/link.stl`` first ``home/me/kit/meshes/link.stl``, last ``link.stl``.
        """
        if name not in self.found:
            self.found[name] = self._find(name)
        found = self.found[name]
        if isinstance(found, str):
            raise FileFormatError(found)
        return found

    def _find(self, name: str) -> Path | str | None:
        """Return the file of a mesh name, None if it is missing, or a text that says why it is not allowed."""
        forbidden: Path | None = None
        for place in self._places(name):
            if not is_file(place):
                continue
            if self._allowed(place, name):
                return place
            forbidden = place if forbidden is None else forbidden
        if forbidden is not None:
            real = forbidden.resolve()
            return (
                f"{self.path}: names {name!r}, which lies outside its folder and its packages, at {str(real)!r}; if it "
                f"is to be read, allow it with mesh_folders=[{str(real.parent)!r}] (--mesh-folders)"
            )
        return None

    def available(self, name: str) -> bool:
        """Return whether a mesh file exists and may be read."""
        try:
            return self.find(name) is not None
        except FileFormatError:
            return False

    def _places(self, name: str) -> Iterator[Path]:
        """Paths that a mesh name may mean, the most literal first."""
        package = _package(name)
        plain = _plain(name)
        tails = _tails(plain)
        yield self._relative(name)
        if package is not None:  # the folder of a package may have been renamed
            title, inner = package
            for place in (*self._packages(title), *self._own()):
                yield place / inner
                if "%" in inner:
                    yield place / unquote(inner)
        elif is_absolute(plain):
            yield from _below(self._own(), tails)
        else:
            yield self.path.parent / plain
        yield from _below(self.more, tails)

    def _allowed(self, file: Path, name: str) -> bool:
        """Return whether a file lies in the allowed folders, with symbolic links resolved."""
        folders = [*self._own(), *ros_folders(), *self.more]
        package = _package(name)
        if package is not None and package[0] not in ("..", "."):
            folders += self._packages(package[0])

        real = file.resolve()
        for folder in folders:
            for place in (folder, *origins(folder)):
                if real.is_relative_to(place.resolve()):
                    return True
        return False

    def rule(self, name: str) -> str:
        """Describe where `find` searches for a mesh."""
        package = _package(name)
        if package is not None:
            return (
                f"for the package {package[0]!r} in {str(self.path.parent)!r} and every folder above, in "
                "ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, and in folders given with --mesh-folders"
            )
        text = f"at {str(self._relative(name))!r}"
        if is_absolute(_plain(name)):
            text += f", for the ends of this path in {str(self.path.parent)!r} and its package"
        return text + ", and in folders given with --mesh-folders"

    def _relative(self, name: str) -> Path:
        return self.path.parent / (unquote(name[7:]) if name.startswith("file://") else name)

    def _packages(self, title: str) -> list[Path]:
        """Folders of a package; more than three levels up they must be marked as packages."""
        if title not in self.packages:
            self.packages[title] = list(package_folders(title, self.path, self.more))
        return self.packages[title]

    def _own(self) -> Iterator[Path]:
        """Folder of the robot file, its parent and its package, also those of the target of a symbolic link."""
        for path in dict.fromkeys((self.path, self.path.resolve())):
            yield path.parent
            if not holds_home(path.parent.parent):
                yield path.parent.parent
            for place in path.parent.parents:
                if origins(place):
                    yield place


def _plain(name: str) -> str:
    """Return a mesh name without its scheme and with slashes for the backslashes of Windows."""
    package = _package(name)
    if package is not None:
        return "/".join(package)
    if name.startswith("file://"):
        name = unquote(name[7:])
    return name.replace("\\", "/")


def is_absolute(name: str) -> bool:
    """Return whether a name is absolute, on this or another system."""
    return re.match(r"/|[A-Za-z]:/|/[A-Za-z]:/", name) is not None


def _tails(name: str, most: int = 16) -> list[Path]:
    """Return the ends of a path as relative paths, the longest first."""
    parts = [part for part in name.split("/") if part not in ("", ".", "..") and ":" not in part]
    parts = parts[-most:]
    tails = []
    for first in range(len(parts)):
        tails.append(Path(*parts[first:]))
    return tails


def _below(folders: Iterable[Path], tails: Sequence[Path]) -> Iterator[Path]:
    """Yield each end of a path in each folder, the longest end first."""
    places = [*folders]
    for tail in tails:
        for place in places:
            yield place / tail


def _package(name: str) -> tuple[str, str] | None:
    """Package and path of a name, None for other names.

    Names of packages are such as ``package://robot/meshes/link.stl`` or ``$(find robot)/meshes/link.stl``.
    """
    for pattern in (
        r"(?:package|model):/{2,}([^/]+)/+(.+)",
        r"(?:file://)?\$\(find ([^)]+)\)/+(.+)",
    ):
        match = re.fullmatch(pattern, name, re.DOTALL)
        if match is not None:
            return match[1].strip(), match[2]
    return None

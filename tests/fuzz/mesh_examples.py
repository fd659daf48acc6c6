"""One tetrahedron in every format of meshes."""

import base64
import json
import struct

import numpy as np

CORNERS = np.array([[0.0, 0, 0], [0.2, 0, 0], [0, 0.1, 0], [0, 0, 0.05]])
TETRAHEDRON = np.array(
    [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
)  # counter-clockwise seen from outside


def stl(points: np.ndarray = CORNERS, triangles: np.ndarray = TETRAHEDRON) -> bytes:
    facets = [
        np.concatenate([np.zeros(3), points[row].reshape(-1)]).astype("<f4").tobytes()
        for row in triangles
    ]
    return (
        bytes(80)
        + len(facets).to_bytes(4, "little")
        + b"".join(facet + b"\0\0" for facet in facets)
    )


NUMBERS = " ".join(f"{x:g}" for x in CORNERS.ravel())
ROWS = " ".join(map(str, TETRAHEDRON.ravel()))
SHOWN = '<instance_geometry url="#g"/>'


def dae(
    shape=f'<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{ROWS}</p></triangles>',
    nodes=f"<node>{SHOWN}</node>",
    library="",
    accessor='count="4" stride="3"',
    unit="1",
    extra="",
):
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
      <asset><unit meter="{unit}"/><up_axis>Y_UP</up_axis></asset>
      <library_geometries><geometry id="g"><mesh>
        <source id="s"><float_array id="a" count="12">{NUMBERS}</float_array>
          <technique_common><accessor source="#a" {accessor}/></technique_common></source>
        <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{shape}</mesh></geometry>
      </library_geometries><library_nodes>{library}</library_nodes>{extra}
      <library_visual_scenes><visual_scene id="w">{nodes}</visual_scene></library_visual_scenes>
      <scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def gltf(count=12, positions=4, buffer=None, nodes=({"mesh": 0},), view_length=None, **more):
    content = TETRAHEDRON.astype("<u4").tobytes() + CORNERS.astype("<f4").tobytes()
    uri = (
        "data:application/octet-stream;base64," + base64.b64encode(content).decode()
        if buffer is None
        else buffer
    )
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": list(nodes),
            "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0}]}],
            "buffers": [{"uri": uri, "byteLength": len(content)}],
            "bufferViews": [
                {"buffer": 0, "byteOffset": 0, "byteLength": 48},
                {"buffer": 0, "byteOffset": 48, "byteLength": view_length or 48},
            ],
            "accessors": [
                {"bufferView": 0, "componentType": 5125, "count": count, "type": "SCALAR"},
                {"bufferView": 1, "componentType": 5126, "count": positions, "type": "VEC3"},
            ],
            **more,
        }
    )


def glb(text):
    text = text.encode() + b" " * (-len(text.encode()) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


PLY = """ply
format ascii 1.0
element vertex {}
property float x
property float y
property float z
element face {}
property list uchar int vertex_indices
end_header
"""
LINES = [" ".join(f"{x:g}" for x in point) for point in CORNERS]
POINT_LINES = "\n".join(LINES)
FACE_LINES = "\n".join("3 " + " ".join(map(str, row)) for row in TETRAHEDRON)
OBJ = "".join(f"v {line}\n" for line in LINES)

GOOD = {
    "binary.stl": stl(),
    "longer.stl": stl() + b"made by hand",
    "text.stl": "solid\n"
    + "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {LINES[i]}\n" for i in row)
        + "endloop\nendfacet\n"
        for row in TETRAHEDRON
    )
    + "endsolid\n",
    "a.obj": OBJ + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in TETRAHEDRON),
    "relative.obj": OBJ + "".join(f"f {a - 4} {b - 4} {c - 4}\n" for a, b, c in TETRAHEDRON),
    "a.ply": PLY.format(4, 4) + POINT_LINES + "\n" + FACE_LINES + "\n",
    "a.off": "OFF\n4 4 0\n" + POINT_LINES + "\n" + FACE_LINES + "\n",
    "a.gltf": gltf(),
    "a.glb": glb(gltf()),
    "a.dae": dae(),
    "polygons.dae": dae(
        '<polylist count="4"><input semantic="NORMAL" source="#n" offset="0"/>'
        '<input semantic="VERTEX" source="#v" offset="1"/><vcount>3 3 3 3</vcount><p>'
        + " ".join(f"7 {i}" for i in TETRAHEDRON.ravel())
        + "</p></polylist>"
    ),
    "one by one.dae": dae(
        '<polygons count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
        + "".join(f"<p>{a} {b} {c}</p>" for a, b, c in TETRAHEDRON)
        + "</polygons>"
    ),
    "millimetres.dae": dae(
        unit="0.001", nodes=f"<node><scale>1000 1000 1000</scale>{SHOWN}</node>"
    ),
    "moved.dae": dae(
        nodes="<node><translate>1 2 3</translate><rotate>0 0 2 90</rotate><node>"
        "<rotate>0 0 1 -90</rotate><matrix>1 0 0 -1 0 1 0 -2 0 0 1 -3 0 0 0 1</matrix>"
        f"{SHOWN}</node></node>"
    ),
    "elsewhere.dae": dae(
        nodes='<node><instance_node url="#n"/></node>', library=f'<node id="n">{SHOWN}</node>'
    ),
    "no material.dae": dae(
        nodes='<node><instance_geometry url="#g"><bind_material><technique_common>'
        '<instance_material target="#gone"/></technique_common></bind_material>'
        "</instance_geometry></node>"
    ),
    "two lists.dae": dae(
        "".join(
            f'<triangles><input semantic="VERTEX" source="#v" offset="0"/><p>{rows}</p></triangles>'
            for rows in (ROWS[:11], ROWS[12:])
        )
    ),
    "skin.dae": dae(
        nodes='<node><instance_controller url="#c"/></node>',
        extra="<library_controllers>"
        '<controller id="c"><skin source="#g"/></controller></library_controllers>',
    ),
}

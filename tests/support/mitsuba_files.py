"""Mitsuba scenes written for tests."""

import numpy as np
from PIL import Image

SIZE = (96, 64)

# Every shape and every step of a transform, with the names of version 0.5 or of version 3.
SCENE = """<scene version="{version}">
  <default name="tilt" value="25"/>
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="{to_world}"><lookat origin="0.5, 2, 9" target="0.2, 0.1, 0" up="0.1, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="64"/></film>
  </sensor>
  <bsdf type="twosided" id="image"><bsdf type="diffuse">
    <texture name="reflectance" type="bitmap"><string name="filename" value="tex/image.png"/></texture>
  </bsdf></bsdf>
  <bsdf type="twosided" id="green"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.1, 0.6, 0.2"/>
  </bsdf></bsdf>
  <shape type="rectangle">
    <transform name="{to_world}">
      <scale value="6"/><rotate x="1" angle="-90"/><translate y="-1.5"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="cube">
    <transform name="{to_world}">
      <scale x="0.7" y="0.5" z="0.6"/><rotate y="1" angle="$tilt"/><translate x="-2.6" y="0.3"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="sphere">
    <point name="center" x="-0.6" y="0.4" z="0.5"/><float name="radius" value="0.8"/><ref id="image"/>
  </shape>
  <shape type="disk">
    <transform name="{to_world}">
      <matrix value="0.6 0 0.3 1.2 0 0.7 0 0.6 -0.3 0 0.6 0.2 0 0 0 1"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="cylinder">
    <point name="p0" x="2.4" y="-0.6" z="0"/><point name="p1" x="2.9" y="1.2" z="-0.4"/>
    <float name="radius" value="0.4"/><ref id="green"/>
  </shape>
  <shape type="obj">
    <string name="filename" value="bent.obj"/>
    <transform name="{to_world}"><scale value="0.5"/><translate x="0" y="1.9"/></transform><ref id="image"/>
  </shape>
  <shape type="ply">
    <string name="filename" value="bent.ply"/>
    <transform name="{to_world}"><scale value="0.5"/><translate x="1.6" y="2.1"/></transform><ref id="image"/>
  </shape>
  {more}
</scene>"""
OBJ = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"""
PLY = """ply\nformat ascii 1.0\nelement vertex 4
property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v
element face 2\nproperty list uchar int vertex_indices\nend_header
-1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 1 0 1\n3 0 1 2\n3 0 2 3\n"""
AREA_LIGHT = """<shape type="{shape}">
  <transform name="to_world"><scale value="0.5"/><translate y="2"/></transform>{more}
  <emitter type="area"><rgb name="radiance" value="4, 2, 1"/></emitter></shape>"""


def scene_file(folder, text=None, version="3.0.0", more=""):
    (folder / "tex").mkdir(exist_ok=True)
    # A smooth image, since the two renderers filter differently. It has no symmetry, to reveal flips.
    v, u = np.mgrid[0:64, 0:64] / 63.0
    image = np.stack([0.2 + 0.7 * u, 0.9 - 0.6 * v, 0.3 + 0.4 * u * v], axis=-1)
    Image.fromarray((255 * image).astype(np.uint8)).save(folder / "tex" / "image.png")
    (folder / "bent.obj").write_text(OBJ)
    (folder / "bent.ply").write_text(PLY)
    to_world = "toWorld" if version.startswith("0") else "to_world"
    path = folder / "scene.xml"
    path.write_text(text or SCENE.format(version=version, to_world=to_world, more=more))
    return path

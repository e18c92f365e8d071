from .errors import (
    AtlasError as AtlasError,
    GLError as GLError,
    MeshError as MeshError,
    RippleError as RippleError,
    SolverError as SolverError,
    SphereMapError as SphereMapError,
)
from .layouts.build import build_atlas as build_atlas, load_atlas as load_atlas
from .layouts.cube.atlas import SphereAtlas as SphereAtlas, sphere_atlas as sphere_atlas
from .mesh.files import load_mesh as load_mesh
from .mesh.mesh import Mesh as Mesh
from .mesh.volume import Volume as Volume, load_volume as load_volume
from .mesh.wrap import Wrap as Wrap, wrap as wrap
from .operator.assembly import build_operator as build_operator
from .operator.material import Material as Material
from .operator.modes import Modes as Modes, modes as modes
from .operator.regions import absorbing_damping as absorbing_damping, hold as hold
from .texels.atlas import Atlas as Atlas
from .texels.gluing import glue as glue
from .texels.maps import texture_map as texture_map, vertex_map as vertex_map
from .texels.texel_atlas import texel_atlas as texel_atlas
from .texels.texel_mesh import TexelMesh as TexelMesh
from .texels.thickness import thickness_map as thickness_map
from .texels.topology import TexelTopology as TexelTopology
from .waves.footprint import Footprint as Footprint
from .waves.height_map import HeightMap as HeightMap
from .waves.load import Load as Load
from .waves.press import Imprint as Imprint
from .waves.wave_solver import WaveSolver as WaveSolver

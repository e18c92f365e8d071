"""`RippleRenderer` renders the frames of a user's loop instead of `mujoco.Renderer`."""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path
from typing import Self, TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from ripple_sim.capture.frame_source import surface_of
from ripple_sim.capture.shown_waves import ShownWaves
from ripple_sim.capture.snapshot import drawn_heights
from ripple_sim.coupling.geoms import ByGeom, by_name
from ripple_sim.coupling.ids import TargetId
from ripple_sim.coupling.own_model import check_targets, own_data, own_model, posed
from ripple_sim.coupling.ripples import Ripples
from ripple_sim.errors import RenderError, SceneError
from ripple_sim.render import AnyHeightMap, Camera, FixedCamera, Renderer
from ripple_sim.render.camera import Viewpoint, find_viewpoint
from ripple_sim.render.mujoco_cameras import (
    mujoco_camera,
    pose_of_scene,
    set_scene_camera,
    with_camera_poses,
)
from ripple_sim.render.visuals.scene_light import in_studio
from ripple_sim.render.visuals.surroundings import followed_flags
from ripple_sim.scene.camera_entry import CameraEntry
from ripple_sim.solver.errors import GLError, checked, instance, warn_caller, whole
from ripple_sim.solver.gl import GLContext, shared_context

from .colors import colors_by_name
from .exporter import Exporter, camera_entry, framed

AnyCamera: TypeAlias = Camera | FixedCamera | str | int | mujoco.MjvCamera

# Attributes of the scene's cameras that are numbers.
_CAMERA_NUMBERS = (
    "orthographic",
    "frustum_bottom",
    "frustum_center",
    "frustum_far",
    "frustum_near",
    "frustum_top",
    "frustum_width",
)

# Attributes of the scene's lights that are drawn.
_LIGHT_ARRAYS = ("pos", "dir", "attenuation", "ambient", "diffuse", "specular")
_LIGHT_NUMBERS = ("type", "cutoff", "exponent", "castshadow", "bulbradius")


class RippleRenderer:
    """Renders a model and its rippling surfaces offscreen, with the interface of `mujoco.Renderer`.

    Frames have lights, shadows and materials of their own; depth and segmentation are as in MuJoCo,
    with the ripples.

    Parameters
    ----------
    model : mujoco.MjModel
        That of the ripples, or one that differs in its looks alone; or dm_control's wrapper of one,
        likewise the data of each frame.
    ripples : Ripples
        Whose targets are drawn with their ripples.
    height : int
        [pixels], whatever the model's offscreen buffer.
    width : int
        [pixels].
    max_geom : int
        Entries that the scene may have.
    font_scale : mujoco.mjtFontScale
        Without effect: no text is drawn.
    looks : mapping
        Geom, by its name or id, to the look of its surface, one of `LOOKS`: rubber (the default),
        jelly, clay and so on. Its colour is the geom's, where the model gives it a texture or a
        colour, as in a scene file; one without either is grey, as in MuJoCo, unless it is named
        here.
    colors : mapping
        Geom, by its name or id, to the colour of its surface, sRGB from 0 to 1, instead of that of
        the model or the look.
    gl : GLContext, optional
        By default the process's shared one.
    limit : bool
        Whether heights that are too large for the object are drawn smaller, so that its surface
        does not pass through itself; see `DisplacementLimit`.
    lighting : str
        "model": MuJoCo's own lights, the headlight among them, before the skybox or black;
        "studio": a photo studio in their place; "auto": the studio where the model has no
        `<light>`.

    Attributes
    ----------
    model : mujoco.MjModel
    scene : mujoco.MjvScene
        What the latest `update_scene` took in. `render` draws what stands in it: whatever is
        changed, added or taken away before is seen, in depth and segmentation too.
    height : int
        [pixels].
    width : int
        [pixels].

    Raises
    ------
    RippleError
        If the ripples belong to another model, for an unknown look or geom, or if the driver cannot
        render frames of this size.
    """

    @checked(
        RenderError,
        ripples=instance(Ripples, ", for instance Ripples(model, materials)"),
        width=whole(1),
        height=whole(1),
        max_geom=whole(1),
        gl=instance(GLContext, ", from shared_context", optional=True),
    )
    def __init__(
        self,
        model: mujoco.MjModel,
        ripples: Ripples,
        height: int = 240,
        width: int = 320,
        max_geom: int = 10_000,
        font_scale: mujoco.mjtFontScale = mujoco.mjtFontScale.mjFONTSCALE_150,
        *,
        looks: ByGeom[str] | None = None,
        colors: ByGeom[tuple[float, float, float]] | None = None,
        gl: GLContext | None = None,
        limit: bool = True,
        lighting: str = "model",
    ) -> None:
        self.model = own_model(model)
        self._ripples = ripples
        check_targets(self.model, ripples.model, ripples.geom_ids)
        named = by_name(self.model, looks or {}, "looks")
        self._shown = ShownWaves(ripples, height)
        self.height = int(height)
        self.width = int(width)
        self._looks = named
        self._colors = colors_by_name(self.model, colors)
        self._limit = limit
        self._lighting = lighting
        self.scene = mujoco.MjvScene(self.model, max_geom)
        self._usual_flags = self.scene.flags.copy()
        self._told_flags = set[int]()
        self._shows = "colours"
        self._seen: tuple[mujoco.MjData, CameraEntry] | None = None
        self._drawn: tuple[mujoco.MjData, dict[TargetId, AnyHeightMap], Viewpoint] | None = None
        self._camera_taken: list[object] = []
        self._lights_taken: list[object] = []
        self._gl = gl or shared_context()
        ripples.follow_shapes()
        self._renderer: Renderer | None = self._make_renderer()

    def enable_depth_rendering(self) -> None:
        """Have `render` return depths from now on."""
        self._shows = "depth"

    def disable_depth_rendering(self) -> None:
        """Have `render` return no depths any more."""
        self._shows = "colours" if self._shows == "depth" else self._shows

    def enable_segmentation_rendering(self) -> None:
        """Have `render` return what each pixel shows from now on."""
        self._shows = "segmentation"

    def disable_segmentation_rendering(self) -> None:
        """Have `render` return no segmentation any more."""
        self._shows = "colours" if self._shows == "segmentation" else self._shows

    def upload_texture(self, texture: int) -> None:
        """Draw a texture of the model, by its id, as it is now, as `mujoco.mjr_uploadTexture` does.

        There is no need to call this: what a program writes into the model's textures, height
        fields and meshes is seen when the next frame is drawn. Of more than a megabyte of textures,
        a change of single pixels may come some frames later.
        """
        self._upload("texture", texture, self.model.ntex)

    def upload_hfield(self, hfield: int) -> None:
        """Draw a height field of the model, by its id, as it is now; see `upload_texture`."""
        self._upload("hfield", hfield, self.model.nhfield)

    def upload_mesh(self, mesh: int) -> None:
        """Draw a mesh of the model, by its id, as it is now; see `upload_texture`."""
        self._upload("mesh", mesh, self.model.nmesh)

    def update_scene(
        self,
        data: mujoco.MjData,
        camera: AnyCamera = -1,
        scene_option: mujoco.MjvOption | None = None,
    ) -> None:
        """Take in the present state of bodies and ripples, which `render` draws.

        Later changes of the data and the ripples have no effect on the frame.

        Parameters
        ----------
        data : mujoco.MjData
            After `mj_step` or `mj_forward`. Where no poses were ever computed, those of its `qpos`
            are drawn.
        camera : Camera, FixedCamera, str, int or mujoco.MjvCamera
            A camera, or the name or the id of one in the MJCF, or one of MuJoCo's that is free,
            tracks a body or is fixed; by default, and with -1, MuJoCo's free camera, aimed at the
            model's middle.
        scene_option : mujoco.MjvOption, optional
            What is shown: groups, contacts, joints and so on; MuJoCo's defaults by default.

        Raises
        ------
        SceneError
            If the data belongs to another model, or the camera is none of these or not in the
            model; then it is a ValueError, too.
        """
        now = own_data(self.model, data, drawn=True)
        self._follow_shapes()
        state = mujoco.MjData(self.model) if self._drawn is None else self._drawn[0]
        mujoco.mj_copyData(state, self.model, with_camera_poses(self.model, posed(self.model, now)))
        try:
            seen = find_viewpoint(self.model, state, camera)
            own = self._own(camera)
        except SceneError as error:
            raise RenderError(str(error)) from None
        option = scene_option or mujoco.MjvOption()
        everything = int(mujoco.mjtCatBit.mjCAT_ALL)
        mujoco.mjv_updateScene(self.model, state, option, None, own, everything, self.scene)
        pose = seen.pose()
        in_scene = pose_of_scene(self.scene.camera, pose.distance)
        seen = dataclasses.replace(in_scene, lens=pose.lens, focal_distance=pose.focal_distance)
        self._camera_taken = _camera_content(self.scene)
        self._lights_taken = _light_content(self.scene)
        heights = {name: self._ripples[name].snapshot() for name in self._height_maps}
        self._shown.look(state, heights, seen.pose(), self._ripples.last_impulses)
        height_maps = {
            self._ripples.geom_ids[name]: height_map(heights[name], state)
            for name, height_map in self._height_maps.items()
        }
        self._drawn = (state, height_maps, seen)
        self._seen = (now, self._entry(camera, own))

    def render(
        self,
        data: mujoco.MjData | None = None,
        camera: AnyCamera | None = None,
        *,
        out: NDArray | None = None,
    ) -> NDArray:
        """Render what the latest `update_scene` took in, or the present state of the data.

        Parameters
        ----------
        data, camera : optional
            As for `update_scene`, which is then called first.
        out : array, optional
            Array of the result's shape and of any type: receives the result.

        Returns
        -------
        array
            Colours, uint8 [height, width, 3]; or depth, float32 [height, width]: distance along the
            camera's axis [m], that of the far plane where nothing is; or segmentation, int32
            [height, width, 2]: id and type (of `mujoco.mjtObj`) of what is seen, -1 where nothing
            is. Before the first `update_scene` there is nothing.

        Raises
        ------
        RippleError
            As `update_scene` does; if `out` has another shape (a ValueError, too); or after `close`
            (a RuntimeError, too).
        """
        if self._renderer is None:
            raise GLError(
                "the renderer is closed: render cannot be called after close; make another one"
            )
        if data is not None:
            self.update_scene(data, -1 if camera is None else camera)
        shape = (
            self.height,
            self.width,
            *{"colours": (3,), "depth": (), "segmentation": (2,)}[self._shows],
        )
        if out is not None and out.shape != shape:
            raise RenderError(
                f"out must have the shape of the {self._shows}, {list(shape)}, got "
                f"{list(out.shape)}"
            )
        if self._shows == "colours":  # MuJoCo has none of them in the others
            self._warn_of_flags()
        if self._drawn is None:
            frame = self._empty_frame()
        elif self._shows == "colours":
            lights = self.scene.lights[: self.scene.nlight]
            edited = _light_content(self.scene) != self._lights_taken
            frame = self._renderer.render(
                *self._now(), scene=self.scene, lights=lights if edited else None
            )
        else:
            segmented = self._shows == "segmentation"
            image = self._renderer.surfaces(*self._now(), scene=self.scene, segmented=segmented)
            # beyond the far plane as in MuJoCo
            nothing = (image.depth == 0) | (image.depth > self._far)
            if self._shows == "depth":
                frame = np.where(nothing, self._far, image.depth)
            else:
                frame = np.where(nothing[..., None], np.int32(-1), image.identity)
        if out is None:
            return frame
        np.copyto(out, frame, casting="unsafe")
        return out

    def close(self) -> None:
        """Release the objects on the GPU; nothing can be rendered afterwards.

        Repeated calls do nothing.

        Warns of waves that were there, but in no scene taken in higher than a pixel.
        """
        if self._renderer is not None:
            self._shown.warn_of_low()
            self._renderer.close()
        self._renderer = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _make_renderer(self) -> Renderer:
        """A renderer for the targets' surfaces as they are now."""
        ripples = self._ripples
        looks = self._looks
        colors = self._colors
        self._atlases = {name: ripples[name].rest for name in ripples}
        self._height_maps = {name: drawn_heights(ripples, name, self._limit) for name in ripples}
        surfaces = {
            geom: dataclasses.replace(
                surface_of(ripples[name], looks.get(name, "rubber"), colors.get(name)),
                grey=name not in looks,
            )
            for name, geom in ripples.geom_ids.items()
        }
        renderer = Renderer(
            self._gl,
            self.model,
            surfaces,
            size=(self.width, self.height),
            lighting=self._lighting,
            backdrop=in_studio(self.model, self._lighting),
        )
        renderer.watch()
        return renderer

    def _follow_shapes(self) -> None:
        """Draw targets whose surfaces a program has changed in the model on their new atlases."""
        self._ripples.follow_shapes()
        changed = any(
            self._ripples[name].rest is not atlas for name, atlas in self._atlases.items()
        )
        if changed and self._renderer is not None:
            self._renderer.close()
            self._renderer = self._make_renderer()

    def _upload(self, kind: str, index: int, count: int) -> None:
        if self._renderer is None:
            raise GLError(
                f"the renderer is closed: upload_{kind} cannot be called after close; make another "
                f"one"
            )
        if not 0 <= index < count:
            raise RenderError(f"{kind} must be an id below {count}, from 0, got {index!r}")
        self._renderer.upload(kind, index)

    def _now(self) -> tuple[mujoco.MjData, dict[TargetId, AnyHeightMap], Viewpoint]:
        """Bodies and waves as they were taken in, and the scene's camera as it is now."""
        if self._drawn is None:
            raise RenderError(
                "there is nothing to render; call update_scene(data) before, or render(data)"
            )
        state, height_maps, seen = self._drawn
        if _camera_content(self.scene) != self._camera_taken:
            try:
                seen = pose_of_scene(self.scene.camera, seen.pose().distance)
            except SceneError as error:
                raise RenderError(str(error)) from None
        return state, height_maps, seen

    @property
    def _far(self) -> np.float32:
        """Distance of MuJoCo's far plane [m]."""
        return np.float32(self.model.vis.map.zfar * self.model.stat.extent)

    def _empty_frame(self) -> NDArray:
        """The value of `render` at pixels without an object."""
        size = self.height, self.width
        if self._shows == "colours":
            return np.zeros((*size, 3), np.uint8)
        if self._shows == "depth":
            return np.full(size, self._far, np.float32)
        return np.full((*size, 2), -1, np.int32)

    def _warn_of_flags(self) -> None:
        """Warn once of each flag of the scene that is not MuJoCo's default and has no effect."""
        changed = set(np.flatnonzero(self.scene.flags != self._usual_flags).tolist())
        followed = followed_flags(backdrop=in_studio(self.model, self._lighting))
        new = changed - followed - self._told_flags
        if new:
            self._told_flags |= new
            names = ", ".join(mujoco.mjtRndFlag(flag).name for flag in sorted(new))
            valid = ", ".join(mujoco.mjtRndFlag(flag).name for flag in sorted(followed))
            warn_caller(
                f"the scene's flags have no effect: {names}; those that have some here are {valid}"
            )

    def _own(self, camera: AnyCamera) -> mujoco.MjvCamera:
        """A camera as MuJoCo's for its scene.

        For a camera of ripple-sim it is the scene's own camera, which is set to the same view.
        """
        pose_of_ours = getattr(camera, "pose", None)
        if not callable(pose_of_ours):
            return mujoco_camera(self.model, camera)
        set_scene_camera(self.scene.camera, pose_of_ours(), self.model)
        own = mujoco.MjvCamera()
        own.type = mujoco.mjtCamera.mjCAMERA_USER
        return own

    def _entry(self, camera: AnyCamera, own: mujoco.MjvCamera) -> CameraEntry:
        """A camera as `[camera]` of a scene file describes it, or else MuJoCo's free camera."""
        if isinstance(camera, Camera):
            return CameraEntry(**dataclasses.asdict(camera))
        if own.type == mujoco.mjtCamera.mjCAMERA_FIXED:
            name = self.model.camera(own.fixedcamid).name
            return camera_entry(self.model, name or None)
        if own.type == mujoco.mjtCamera.mjCAMERA_USER:
            return camera_entry(self.model, None)
        x, y, z = map(float, own.lookat)
        fovy = 45.0 if self.model.vis.global_.orthographic else float(self.model.vis.global_.fovy)
        return CameraEntry(
            lookat=(x, y, z),
            distance=own.distance,
            azimuth=own.azimuth,
            elevation=own.elevation,
            fovy=fovy,
        )

    def _repr_html_(self) -> str | None:
        """HTML for a notebook: the present state of what was rendered last, to turn and to zoom."""
        if self._seen is None:
            return None
        data, camera = self._seen
        size = (self.width, self.height)
        with tempfile.TemporaryDirectory(prefix="ripple-sim-") as folder:
            page = Path(folder) / "now.html"
            with Exporter(
                self.model,
                self._ripples,
                page,
                camera=camera,
                looks=self._looks,
                colors=self._colors,
                size=size,
                limit=self._limit,
                lighting=self._lighting,
            ) as exporter:
                exporter.write(data)
            return framed(page, self.width / self.height)


def _camera_content(scene: mujoco.MjvScene) -> list[object]:
    """All numbers of the cameras of a scene, for comparison."""
    content: list[object] = []
    for camera in scene.camera:
        content += [camera.pos.tobytes(), camera.forward.tobytes(), camera.up.tobytes()]
        content += [getattr(camera, name) for name in _CAMERA_NUMBERS]
    return content


def _light_content(scene: mujoco.MjvScene) -> list[object]:
    """All numbers of the lights of a scene, for comparison."""
    content: list[object] = [scene.nlight]
    for light in scene.lights[: scene.nlight]:
        content += [getattr(light, name).tobytes() for name in _LIGHT_ARRAYS]
        content += [getattr(light, name) for name in _LIGHT_NUMBERS]
    return content

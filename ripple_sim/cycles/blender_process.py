"""Renders a stage with Cycles, frame by frame: `python blender_process.py SETTINGS.json`, in a process of its own.

Blender is under the GPL, which is why nothing of ripple-sim is imported here and only files and lines pass between the
two. Each frame becomes NUMBER.npy, linear, and then the line "frame NUMBER".
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

_FAR = 30.0  # of the soft boxes, in distances of the camera
_DEEP = 0.02  # how far light of a translucent look gets, likewise


def main(settings):
    """Render all frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(
        filepath=settings["stage"], set_frame_range=True, property_import_mode="USER", create_world_material=False
    )
    scene = bpy.context.scene
    scene.camera = next(each for each in scene.objects if each.type == "CAMERA")
    set_rendering(scene, settings)
    set_world(scene, settings)
    for lamp in (each for each in scene.objects if each.type == "LIGHT"):
        lamp.data.energy = lamp.data["power"]
    for material in bpy.data.materials:
        set_look(material, _DEEP * settings["distance"])
    boxes = [soft_box(scene, box, settings) for box in settings["boxes"]]
    fade = fading_floor(settings)
    for number in range(settings["frames"]):
        scene.frame_set(number)
        camera = scene.camera.matrix_world
        for box, lights in zip(settings["boxes"], boxes, strict=True):
            for light in lights:
                light.matrix_world = box_place(camera, box, settings["distance"])
        if fade is not None:
            fade.inputs[1].default_value = camera @ Vector((0, 0, -settings["distance"]))
        save(scene, Path(settings["folder"]), number)


def set_rendering(scene, settings):
    """Engine, size, shutter and file format."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = settings["samples"], True
    scene.cycles.seed = 0
    scene.render.resolution_x, scene.render.resolution_y = settings["size"]
    scene.render.resolution_percentage = 100
    scene.render.fps = settings["fps"]
    scene.render.use_motion_blur = settings["shutter"] > 0
    scene.render.motion_blur_shutter = settings["shutter"]
    scene.render.motion_blur_position = "START"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"


def save(scene, folder, number):
    """Render a frame and leave it as an array."""
    image_file = folder / f"{number}.exr"
    scene.render.filepath = str(image_file)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(image_file))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    image_file.unlink()
    np.save(folder / f"{number}.npy", pixels.reshape(height, width, 4)[::-1, :, :3])
    print(f"frame {number}", flush=True)


def set_world(scene, settings):
    """The sky as the camera sees it, as it is reflected, and as it lights the rest."""
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    nodes, links = scene.world.node_tree.nodes, scene.world.node_tree.links
    nodes.clear()
    rays, seen = nodes.new("ShaderNodeLightPath"), sky_colors(nodes, links, settings)
    color = mixed(nodes, links, rays.outputs["Is Glossy Ray"], settings["sky"], scaled(nodes, links, seen, 0.75))
    color = mixed(nodes, links, rays.outputs["Is Camera Ray"], color, seen)
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(color, background.inputs["Color"])
    links.new(background.outputs[0], output.inputs["Surface"])


def sky_colors(nodes, links, settings):
    """From the horizon's colour to the zenith's."""
    direction, parts = nodes.new("ShaderNodeTexCoord"), nodes.new("ShaderNodeSeparateXYZ")
    links.new(direction.outputs["Generated"], parts.inputs[0])
    rise = smooth_step(nodes, links, parts.outputs["Z"], -0.1, 0.8)
    return mixed(nodes, links, rise, settings["horizon"], settings["zenith"])


def smooth_step(nodes, links, value, low, high):
    """From 0 at `low` to 1 at `high`."""
    step = nodes.new("ShaderNodeMapRange")
    step.interpolation_type = "SMOOTHSTEP"
    step.inputs["From Min"].default_value, step.inputs["From Max"].default_value = low, high
    links.new(value, step.inputs["Value"])
    return step.outputs["Result"]


def mixed(nodes, links, share, first, second):
    """Mix two colours, given as lists or as sockets."""
    mix = nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    links.new(share, mix.inputs[0])
    for socket, color in zip((mix.inputs[6], mix.inputs[7]), (first, second), strict=True):
        if isinstance(color, list):
            socket.default_value = (*color, 1.0)
        else:
            links.new(color, socket)
    return mix.outputs[2]


def scaled(nodes, links, color, factor):
    """Brighten or darken a colour."""
    scale = nodes.new("ShaderNodeVectorMath")
    scale.operation = "SCALE"
    scale.inputs["Scale"].default_value = factor
    links.new(color, scale.inputs[0])
    return scale.outputs[0]


def set_look(material, depth):
    """What UsdPreviewSurface has no word for."""
    shader = next((node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if shader is None or "translucency" not in material:
        return
    color = shader.inputs["Base Color"].default_value
    shader.inputs["Subsurface Weight"].default_value = material["translucency"]
    shader.inputs["Subsurface Radius"].default_value = tuple(max(each, 0.05) for each in color[:3])
    shader.inputs["Subsurface Scale"].default_value = depth
    shader.inputs["Sheen Weight"].default_value = material["sheen"]
    shader.inputs["Transmission Weight"].default_value = material["transparency"]
    shader.inputs["Alpha"].default_value = material["opacity"]


def soft_box(scene, box, settings):
    """Two lights in one place: what is reflected, and the little that ours gives to diffuse surfaces."""
    away = _FAR * settings["distance"]
    lights = []
    for name in ("reflected", "diffuse"):
        light = bpy.data.lights.new(name, "AREA")
        light.shape, light.size, light.size_y = "RECTANGLE", 2 * box["half"][0] * away, 2 * box["half"][1] * away
        brightest = max(box["radiance"])
        light.color = [each / brightest for each in box["radiance"]]
        light.energy = settings[f"boxes_{name}"] * math.pi * brightest * light.size * light.size_y
        thing = bpy.data.objects.new(name, light)
        thing.visible_camera = thing.visible_transmission = False
        thing.visible_diffuse, thing.visible_glossy = name == "diffuse", name == "reflected"
        scene.collection.objects.link(thing)
        lights.append(thing)
    return lights


def box_place(camera, box, distance):
    """A soft box turns with the camera round the vertical."""
    right = camera.to_3x3() @ Vector((1, 0, 0))
    right = Vector((right.x, right.y, 0)).normalized()
    up = Vector((0, 0, 1))
    forward = up.cross(right)
    turn, rise = math.radians(box["azimuth"]), math.radians(box["elevation"])
    way = (forward * math.cos(turn) - right * math.sin(turn)) * math.cos(rise) + up * math.sin(rise)
    focus = camera @ Vector((0, 0, -distance))
    across = up.cross(way).normalized()
    turned = Matrix((across, way.cross(across), way)).transposed()  # lights shine along their -z
    return Matrix.Translation(focus + way * _FAR * distance) @ turned.to_4x4()


def fading_floor(settings):
    """Let the floor fade into the sky; return the node that takes the point from which it does."""
    if settings["floor"] is None:
        return None
    floor = next(
        (each for each in bpy.data.objects if each.type == "MESH" and each.name.split(".")[0] == settings["floor"]),
        None,
    )
    if floor is None or not floor.data.materials:
        return None
    material = floor.data.materials[0] = floor.data.materials[0].copy()
    nodes, links = material.node_tree.nodes, material.node_tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    surface = output.inputs["Surface"].links[0].from_socket
    for name in ("Specular IOR Level", "Coat Weight"):  # ours is matte
        surface.node.inputs[name].default_value = 0.0
    place, apart = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeVectorMath")
    apart.operation = "DISTANCE"
    links.new(place.outputs["Position"], apart.inputs[0])
    near, far = (each * settings["distance"] for each in settings["fade"])
    share = smooth_step(nodes, links, apart.outputs["Value"], near, far)
    glow, mix = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeMixShader")
    glow.inputs["Color"].default_value = (*settings["horizon"], 1.0)
    links.new(share, mix.inputs[0])
    links.new(surface, mix.inputs[1])
    links.new(glow.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    return apart


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))

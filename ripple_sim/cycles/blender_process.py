"""Render a USD stage with Cycles: `python blender_process.py SETTINGS.json`.

It runs in a process of its own. Blender is under the GPL, which is why nothing of ripple-sim is
imported here and only files and lines pass between the two. Each frame becomes NUMBER.npy, linear,
and then the line "frame NUMBER".
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

# How far light travels under a translucent surface, over the distance of the focus.
_SCATTER = 0.02


def main(settings):
    """Render all frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.usd_import(
        filepath=settings["stage"],
        set_frame_range=True,
        property_import_mode="USER",
        create_world_material=False,
    )
    scene = bpy.context.scene
    scene.camera = next(item for item in scene.objects if item.type == "CAMERA")
    set_rendering(scene, settings)
    box_axes = set_world(scene, settings)
    for lamp in [item for item in scene.objects if item.type == "LIGHT"]:
        # the importer makes lamps four times as strong, and suns twice as wide
        lamp.data.energy = lamp.data["power"]
        if lamp.data.type == "SUN":
            lamp.data.angle = lamp.data["angle"]
    for material in bpy.data.materials:
        set_look(material, _SCATTER * settings["distance"])
    fade = fading_floor(settings)
    for number in range(settings["frames"]):
        scene.frame_set(number)
        camera = scene.camera.matrix_world
        for box, axes in zip(settings["boxes"], box_axes, strict=True):
            for node, axis in zip(axes, axes_of(camera, box), strict=True):
                node.inputs[1].default_value = axis
        if fade is not None:
            fade.inputs[1].default_value = camera @ Vector((0, 0, -settings["distance"]))
        save(scene, Path(settings["folder"]), number)


def set_rendering(scene, settings):
    """Engine, size, shutter and file format."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = settings["samples"]
    scene.cycles.use_denoising = True
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
    """Set up the world: the sky and the soft boxes of the studio.

    The camera, reflections and diffuse light see different versions of them.

    Return the nodes that take the axes of each box. Where directions are chosen for light alone,
    Cycles does not know what kind of ray will meet the sky: surfaces choose them.
    """
    scene.world = bpy.data.worlds.new("sky")
    scene.world.use_nodes = True
    scene.world.cycles.sampling_method = "NONE"
    tree = scene.world.node_tree
    nodes = tree.nodes
    links = tree.links
    nodes.clear()
    rays = nodes.new("ShaderNodeLightPath")
    direction = nodes.new("ShaderNodeTexCoord")
    coordinates = nodes.new("ShaderNodeSeparateXYZ")
    links.new(direction.outputs["Generated"], coordinates.inputs[0])
    sky_color = mixed(
        tree,
        smooth_step(tree, coordinates.outputs["Z"], -0.1, 0.8),
        settings["horizon"],
        settings["zenith"],
    )
    boxes, axes = soft_boxes(tree, settings["boxes"])
    diffuse = vectors(tree, "SCALE", boxes, settings["boxes_diffuse"])
    diffuse = vectors(tree, "ADD", settings["sky"], diffuse)
    glossy = vectors(tree, "SCALE", boxes, settings["boxes_reflected"])
    glossy = vectors(tree, "ADD", glossy, vectors(tree, "SCALE", sky_color, 0.75))
    color = mixed(tree, rays.outputs["Is Glossy Ray"], diffuse, glossy)
    for kind in ("Is Camera Ray", "Is Transmission Ray"):
        color = mixed(tree, rays.outputs[kind], color, sky_color)
    background = nodes.new("ShaderNodeBackground")
    output = nodes.new("ShaderNodeOutputWorld")
    links.new(color, background.inputs["Color"])
    links.new(background.outputs[0], output.inputs["Surface"])
    return axes


def soft_boxes(tree, boxes):
    """Radiance of the boxes, which are far away, and the nodes for the axes of each box.

    The axes are towards the box, across and up.
    """
    direction = tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    total = [0.0, 0.0, 0.0]
    axes = []
    for box in boxes:
        shares = [vectors(tree, "DOT_PRODUCT", direction, [0.0, 0.0, 0.0]) for _ in range(3)]
        inside = maths(tree, "GREATER_THAN", shares[0], 0.0)
        for share, half in zip(shares[1:], box["half"], strict=True):
            limit = maths(tree, "MULTIPLY", shares[0], half)
            near = maths(tree, "LESS_THAN", maths(tree, "ABSOLUTE", share, 0.0), limit)
            inside = maths(tree, "MULTIPLY", inside, near)
        total = vectors(tree, "ADD", total, vectors(tree, "SCALE", box["radiance"], inside))
        axes.append([share.node for share in shares])
    return total, axes


def smooth_step(tree, value, low, high):
    """From 0 at `low` to 1 at `high`."""
    step = tree.nodes.new("ShaderNodeMapRange")
    step.interpolation_type = "SMOOTHSTEP"
    step.inputs["From Min"].default_value = low
    step.inputs["From Max"].default_value = high
    tree.links.new(value, step.inputs["Value"])
    return step.outputs["Result"]


def mixed(tree, share, first, second):
    """Mix two colours, given as lists or as sockets."""
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    tree.links.new(share, mix.inputs[0])
    for socket, color in zip((mix.inputs[6], mix.inputs[7]), (first, second), strict=True):
        set_input(tree, socket, [*color, 1.0] if isinstance(color, list) else color)
    return mix.outputs[2]


def vectors(tree, operation, first, second):
    """Add a vector operation, and return its output socket.

    The operands are vectors or sockets, or for a scaling a vector and a number.
    """
    node = tree.nodes.new("ShaderNodeVectorMath")
    node.operation = operation
    set_input(tree, node.inputs[0], first)
    set_input(tree, node.inputs["Scale" if operation == "SCALE" else 1], second)
    return node.outputs["Value" if operation == "DOT_PRODUCT" else "Vector"]


def maths(tree, operation, first, second):
    """Number of an operation on two numbers, given as they are or as sockets."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    set_input(tree, node.inputs[0], first)
    set_input(tree, node.inputs[1], second)
    return node.outputs[0]


def set_input(tree, socket, value):
    """Link a socket, or set it to a number or a list."""
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    else:
        socket.default_value = value


def set_look(material, depth):
    """The properties of a look that UsdPreviewSurface lacks."""
    shader = next(
        (node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None
    )
    if shader is None or "translucency" not in material:
        return
    color = shader.inputs["Base Color"].default_value
    shader.inputs["Subsurface Weight"].default_value = material["translucency"]
    radius = tuple(max(channel, 0.05) for channel in color[:3])
    shader.inputs["Subsurface Radius"].default_value = radius
    shader.inputs["Subsurface Scale"].default_value = depth
    shader.inputs["Sheen Weight"].default_value = material["sheen"]
    shader.inputs["Sheen Tint"].default_value = color
    shader.inputs["Transmission Weight"].default_value = material["transparency"]
    shader.inputs["Alpha"].default_value = material["opacity"]


def axes_of(camera, box):
    """Axes of a soft box, which turns with the camera round the vertical: to it, across, up."""
    right = camera.to_3x3() @ Vector((1, 0, 0))
    right = Vector((right.x, right.y, 0)).normalized()
    up = Vector((0, 0, 1))
    forward = up.cross(right)
    turn = math.radians(box["azimuth"])
    rise = math.radians(box["elevation"])
    way = (forward * math.cos(turn) - right * math.sin(turn)) * math.cos(rise) + up * math.sin(rise)
    across = up.cross(way).normalized()
    return way, across, way.cross(across)


def fading_floor(settings):
    """Let the floor, if there is one, fade into the sky.

    Returns the node that takes the point from which the floor fades.
    """
    meshes = [item for item in bpy.data.objects if item.type == "MESH"]
    floor = next((mesh for mesh in meshes if mesh.name.split(".")[0] == settings["floor"]), None)
    if floor is None or not floor.data.materials:
        return None
    material = floor.data.materials[0] = floor.data.materials[0].copy()
    tree = material.node_tree
    nodes = tree.nodes
    links = tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    surface = output.inputs["Surface"].links[0].from_socket
    for name in ("Specular IOR Level", "Coat Weight"):  # ours is matte
        surface.node.inputs[name].default_value = 0.0
    place = nodes.new("ShaderNodeNewGeometry")
    apart = nodes.new("ShaderNodeVectorMath")
    apart.operation = "DISTANCE"
    links.new(place.outputs["Position"], apart.inputs[0])
    fade_begin, fade_end = settings["fade"]  # in distances of the focus
    focus = settings["distance"]
    share = smooth_step(tree, apart.outputs["Value"], fade_begin * focus, fade_end * focus)
    glow = nodes.new("ShaderNodeEmission")
    mix = nodes.new("ShaderNodeMixShader")
    glow.inputs["Color"].default_value = (*settings["horizon"], 1.0)
    links.new(share, mix.inputs[0])
    links.new(surface, mix.inputs[1])
    links.new(glow.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    return apart


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")))

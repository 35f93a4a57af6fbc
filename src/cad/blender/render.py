"""Renders the scene that `mod.rs` describes in the folder given after `--`, with Cycles.

World = object frame. Per frame two files: `colour-<n>.exr` (means over each pixel) and `centre-<n>.exr` (one ray
through each pixel's centre: mask and z).
"""

import json
import os
import sys

import bpy
from mathutils import Matrix

folder = sys.argv[sys.argv.index("--") + 1]
with open(os.path.join(folder, "scene.json"), encoding="utf-8") as file:
    description = json.load(file)


def build_light():
    """A node group: corner normal in, share of the surface's colour out; and its nodes that each frame sets."""
    group = bpy.data.node_groups.new("light", "ShaderNodeTree")
    group.outputs.new("NodeSocketFloat", "intensity")
    nodes, links = group.nodes, group.links
    normal = nodes.new("ShaderNodeAttribute")
    normal.attribute_name = "corner_normal"
    unit = nodes.new("ShaderNodeVectorMath")
    unit.operation = "NORMALIZE"
    links.new(normal.outputs["Vector"], unit.inputs[0])
    dot = nodes.new("ShaderNodeVectorMath")
    dot.operation = "DOT_PRODUCT"
    links.new(unit.outputs[0], dot.inputs[0])
    # The side that is seen: 1 - 2 * backfacing.
    geometry = nodes.new("ShaderNodeNewGeometry")
    side = math(nodes, links, "MULTIPLY_ADD", geometry.outputs["Backfacing"], -2.0, 1.0)
    towards = math(nodes, links, "MULTIPLY", dot.outputs["Value"], side)
    lit = math(nodes, links, "MAXIMUM", towards, 0.0)
    shade = nodes.new("ShaderNodeMath")
    shade.operation = "MULTIPLY_ADD"
    links.new(lit, shade.inputs[0])
    output = nodes.new("NodeGroupOutput")
    links.new(shade.outputs[0], output.inputs["intensity"])
    return group, dot, shade


def math(nodes, links, operation, *inputs):
    node = nodes.new("ShaderNodeMath")
    node.operation = operation
    for socket, value in zip(node.inputs, inputs):
        if isinstance(value, float):
            socket.default_value = value
        else:
            links.new(value, socket)
    return node.outputs[0]


def build_material(entry, light):
    """Emission of colour times light; a hole where it is less opaque than `hole`."""
    material = bpy.data.materials.new("surface")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    if not entry["texture"] and entry["opacity"] < description["hole"]:
        links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], output.inputs["Surface"])
        return material
    shade = nodes.new("ShaderNodeGroup")
    shade.node_tree = light
    tint = nodes.new("ShaderNodeVectorMath")
    tint.operation = "SCALE"
    tint.inputs[0].default_value = entry["diffuse"]
    links.new(shade.outputs["intensity"], tint.inputs["Scale"])
    colour, alpha = tint.outputs[0], None
    if entry["texture"]:
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = bpy.data.images.load(os.path.join(folder, entry["texture"]))
        # Values as they stand in the file, as ours are.
        texture.image.colorspace_settings.name = "Non-Color"
        texture.image.alpha_mode = "CHANNEL_PACKED"
        texture.extension = "REPEAT"
        product = nodes.new("ShaderNodeVectorMath")
        product.operation = "MULTIPLY"
        links.new(texture.outputs["Color"], product.inputs[0])
        links.new(colour, product.inputs[1])
        colour, alpha = product.outputs[0], texture.outputs["Alpha"]
    bounded = nodes.new("ShaderNodeVectorMath")
    bounded.operation = "MINIMUM"
    bounded.inputs[1].default_value = (1.0, 1.0, 1.0)
    links.new(colour, bounded.inputs[0])
    emission = nodes.new("ShaderNodeEmission")
    links.new(bounded.outputs[0], emission.inputs["Color"])
    surface = emission.outputs[0]
    if alpha:
        opacity = math(nodes, links, "MULTIPLY", alpha, entry["opacity"])
        mix = nodes.new("ShaderNodeMixShader")
        links.new(math(nodes, links, "LESS_THAN", opacity, description["hole"]), mix.inputs[0])
        links.new(surface, mix.inputs[1])
        links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], mix.inputs[2])
        surface = mix.outputs[0]
    links.new(surface, output.inputs["Surface"])
    return material


def build_object(light):
    """Every triangle has corners of its own: texture coordinates and normals differ between neighbours."""
    count = len(description["material"])
    mesh = bpy.data.meshes.new("object")
    mesh.vertices.add(3 * count)
    mesh.vertices.foreach_set("co", description["corners"])
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", range(3 * count))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", range(0, 3 * count, 3))
    mesh.polygons.foreach_set("loop_total", [3] * count)
    mesh.polygons.foreach_set("material_index", description["material"])
    mesh.uv_layers.new(name="uv").data.foreach_set("uv", description["texture_coordinates"])
    normals = mesh.attributes.new("corner_normal", "FLOAT_VECTOR", "CORNER")
    normals.data.foreach_set("vector", description["normals"])
    mesh.update(calc_edges=True)
    for entry in description["materials"]:
        mesh.materials.append(build_material(entry, light))
    return bpy.data.objects.new("object", mesh)


def aim(camera, view):
    """Blender's camera looks along -z with y up; its lens shift is in widths, right and up being positive."""
    width, height = description["width"], description["height"]
    camera.data.sensor_fit = "HORIZONTAL"
    camera.data.lens = camera.data.sensor_width * view["focal"] / width
    camera.data.shift_x = 0.5 - view["principal"][0] / width
    camera.data.shift_y = (view["principal"][1] - 0.5 * height) / width
    rotation, translation = view["rotation"], view["translation"]
    camera_from_object = Matrix([row + [t] for row, t in zip(rotation, translation)] + [[0.0, 0.0, 0.0, 1.0]])
    camera.matrix_world = camera_from_object.inverted() @ Matrix.Diagonal((1.0, -1.0, -1.0, 1.0))


def main():
    scene = bpy.context.scene
    for left in list(bpy.data.objects):
        bpy.data.objects.remove(left)
    light, dot, shade = build_light()
    scene.collection.objects.link(build_object(light))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.clip_start, camera.data.clip_end = description["near"], 1e4
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = None

    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y = description["width"], description["height"]
    render.resolution_percentage = 100
    render.film_transparent = True
    render.use_persistent_data = True
    render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    render.image_settings.color_depth = "32"
    scene.view_layers[0].use_pass_z = True
    cycles.use_denoising = False
    cycles.use_adaptive_sampling = False
    # Surfaces shine by themselves: no light is traced further than to the eye.
    cycles.max_bounces = 0
    cycles.transparent_max_bounces = 256

    def film(kind):
        for number, view in enumerate(description["views"]):
            aim(camera, view)
            dot.inputs[1].default_value = view["light"]["direction"]
            shade.inputs[1].default_value = view["light"]["diffuse"]
            shade.inputs[2].default_value = view["light"]["ambient"]
            render.filepath = os.path.join(folder, f"{kind}-{number}.exr")
            bpy.ops.render.render(write_still=True)

    # A box one pixel wide: the mean over the pixel.
    cycles.samples, cycles.pixel_filter_type = description["samples"], "BOX"
    film("colour")
    # Cycles keeps the first sample's z, wherever in the pixel that is; so hold it at the centre.
    cycles.samples, cycles.pixel_filter_type, cycles.filter_width = 1, "BLACKMAN_HARRIS", 0.01
    film("centre")


main()

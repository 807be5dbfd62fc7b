"""Objects that lie in the flat, and pictures of them with the noise of a robot's cameras."""

import cv2
import numpy as np

from executive.app.prepare.worlds import knowledge_of, open_world
from plant.diagram import DiagramConfig, LooseModel, build_diagram
from plant.rendering import RENDERER, render_parameters
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.api import Surface
from skills.robot import FrameTree, Image, Pose2D

SURFACES = ("coffee table", "sideboard", "dresser", "bathroom cabinet", "desk", "workbench", "kitchen counter")


def surface_of(name, world="flat"):
    facts = knowledge_of(open_world(world)).surfaces[name]
    return Surface(name, tuple((float(x), float(y)) for x, y in facts.polygon), facts.height)


def viewpoint_of(rng, name):
    views = knowledge_of(open_world("flat")).surfaces[name].viewpoints
    view = views[int(rng.integers(len(views)))]
    return Pose2D(view.x, view.y, view.yaw)


class FlatScene:
    """The flat, or another world, with models at poses; `bodies` are their labels in Drake's label images."""

    def __init__(self, models, robots=(), world="flat"):
        loose = [LooseModel(f"thing{k}", file, X_WO, fixed=True) for k, (file, X_WO) in enumerate(models)]
        directives, parameters = open_world(world).directives_path, render_parameters()
        self.built = build_diagram(
            DiagramConfig(directives, loose, robots=list(robots), visuals=False, renderer_parameters=parameters)
        )
        assert self.built.scene is not None
        plant, self._frame = self.built.plant, self.built.scene_graph.world_frame_id()
        self._query = self.built.scene.query_at(plant.GetPositions(plant.CreateDefaultContext()))
        self.bodies = [int(plant.GetBodyIndices(self.built.models[each.name])[0]) for each in loose]

    def colour(self, X_WC, lens):
        """Clean picture (H, W, 3)."""
        picture = self._query.RenderColorImage(colour_render_camera(lens, RENDERER), self._frame, X_WC)
        return np.ascontiguousarray(picture.data[..., :3])

    def labels(self, X_WC, lens):
        """Body of each pixel (H, W)."""
        picture = self._query.RenderLabelImage(colour_render_camera(lens, RENDERER), self._frame, X_WC)
        return np.array(picture.data[..., 0], dtype=np.int16)

    def depth_m(self, X_WC, lens, range_m):
        """Clean depth (H, W) in m."""
        picture = self._query.RenderDepthImage(depth_render_camera(lens, RENDERER, range_m), self._frame, X_WC)
        return np.asarray(picture.data[..., 0], dtype=np.float32)

    def image(self, rng, spec, X_WC):
        """Picture with depth as the plant's camera takes it."""
        lens, depth_lens = spec.intrinsics(), spec.depth_intrinsics()
        degrader = PictureDegrader(rng, lens.height, lens.width, PictureNoise(), spec.picture_shrink)
        colour = degrader.colour(self.colour(X_WC, lens))
        grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        small = np.asarray(cv2.resize(grey, (depth_lens.width, depth_lens.height)), dtype=np.uint8)
        clean_m = self.depth_m(X_WC, depth_lens, spec.depth_range_m)
        depth_m = DepthDegrader(rng, depth_lens, spec.depth_range_m, DepthNoise()).depth(clean_m, small)
        frames = FrameTree({spec.frame: ("odom", X_WC)})
        return Image(0.0, spec.name, spec.frame, lens, depth_lens, colour, grey, depth_m, frames)

# SPDX-License-Identifier: Apache-2.0
"""3D Gaussian splats with textures: load, save, render to NumPy, train step by step, evaluate, convert.

    import textured_gaussians as tg

    model = tg.Model.load("model.tgz")
    picture = tg.Renderer(model).render(model.cameras[0])  # float32 [height, width, 3]
"""
from . import _core, _refusals

_refusals.shorten(_core)

from ._core import (  # noqa: E402
    Camera,
    ConvertReport,
    Dataset,
    Error,
    Evaluation,
    Model,
    Progress,
    Renderer,
    Trainer,
    ViewScore,
    __version__,
    convert,
    evaluate,
    look_at,
    read_image,
    set_threads,
    write_image,
)

__all__ = [
    "Camera",
    "ConvertReport",
    "Dataset",
    "Error",
    "Evaluation",
    "Model",
    "Progress",
    "Renderer",
    "Trainer",
    "ViewScore",
    "convert",
    "evaluate",
    "look_at",
    "read_image",
    "set_threads",
    "write_image",
]

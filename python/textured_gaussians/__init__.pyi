# SPDX-License-Identifier: Apache-2.0
# The types of the module; what each function does, with shapes and units, is in its docstring.
import os
from typing import Any, Callable, Dict, Iterable, List, Literal, NoReturn, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt

_Path = Union[str, bytes, "os.PathLike[str]", "os.PathLike[bytes]"]
_Value = Union[_Path, int, float, np.generic]
_Vector = Union[Sequence[float], npt.NDArray[np.floating[Any]], npt.NDArray[np.integer[Any]]]
_Color = _Vector
_TextureMode = Literal["none", "alpha", "rgb", "rgba"]
_Output = Literal["final", "base", "texture", "alpha", "depth", "normal", "count", "depth_median"]
_Split = Literal["test", "train", "all"]
_Intersection = Literal["plane", "max_response"]
_Outside = Literal["base", "clip", "edge"]
_Floats = npt.NDArray[np.float32]
_Doubles = npt.NDArray[np.float64]

__version__: str

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

class Error(RuntimeError):
    kind: Literal["usage", "cannot_read", "bad_data", "cannot_write", "device"]

class Camera:
    def __init__(
        self,
        rotation: npt.ArrayLike,
        translation: npt.ArrayLike,
        focal: npt.ArrayLike,
        center: npt.ArrayLike,
        width: int,
        height: int,
        name: _Path = ...,
        test: bool = ...,
    ) -> None: ...
    @property
    def rotation(self) -> _Doubles: ...
    @property
    def translation(self) -> _Doubles: ...
    @property
    def focal(self) -> _Doubles: ...
    @property
    def center(self) -> _Doubles: ...
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def name(self) -> str: ...
    @property
    def test(self) -> bool: ...

def look_at(
    eye: _Vector,
    target: _Vector,
    up: _Vector,
    fov_y: float,
    width: int,
    height: int,
) -> Camera: ...

class Model:
    def __init__(
        self,
        means: npt.ArrayLike,
        rotations: npt.ArrayLike,
        log_scales: npt.ArrayLike,
        opacity_logits: npt.ArrayLike,
        sh: npt.ArrayLike,
        *,
        texture_mode: _TextureMode = ...,
        texture_rects: Optional[npt.ArrayLike] = ...,
        texels: Optional[npt.ArrayLike] = ...,
        background: _Color = ...,
        cameras: Sequence[Camera] = ...,
        intersection: _Intersection = ...,
        outside: _Outside = ...,
    ) -> None: ...
    @staticmethod
    def load(path: _Path) -> Model: ...
    def save(self, path: _Path) -> List[str]: ...
    def __copy__(self) -> Model: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Model: ...
    def __len__(self) -> int: ...
    @property
    def means(self) -> _Floats: ...
    @property
    def rotations(self) -> _Floats: ...
    @property
    def log_scales(self) -> _Floats: ...
    @property
    def opacity_logits(self) -> _Floats: ...
    @property
    def sh(self) -> _Floats: ...
    @property
    def texels(self) -> _Floats: ...
    @property
    def texture_rects(self) -> npt.NDArray[np.int64]: ...
    @property
    def sh_degree(self) -> int: ...
    @property
    def texture_mode(self) -> _TextureMode: ...
    @property
    def intersection(self) -> _Intersection: ...
    @property
    def outside(self) -> _Outside: ...
    @property
    def background(self) -> Tuple[float, float, float]: ...
    @property
    def cameras(self) -> List[Camera]: ...
    @property
    def warnings(self) -> List[str]: ...

class Renderer:
    def __init__(self, model: Model) -> None: ...
    def render(
        self,
        camera: Camera,
        output: _Output = ...,
        *,
        textures: _TextureMode = ...,
        background: Optional[_Color] = ...,
        splat_scale: float = ...,
        opacity_scale: float = ...,
        max_sh_degree: int = ...,
    ) -> _Floats: ...

def set_threads(count: int) -> None: ...
def read_image(path: _Path) -> _Floats: ...
def write_image(path: _Path, image: npt.NDArray[np.floating[Any]]) -> None: ...

class Dataset:
    def __init__(
        self,
        images: Iterable[npt.NDArray[Union[np.uint8, np.floating[Any]]]],
        cameras: Sequence[Camera],
        *,
        names: Optional[Sequence[_Path]] = ...,
        points: Optional[npt.ArrayLike] = ...,
        colors: Optional[npt.NDArray[Union[np.uint8, np.floating[Any]]]] = ...,
        masks: Optional[Iterable[Optional[npt.NDArray[Union[np.bool_, np.uint8]]]]] = ...,
        background: Optional[_Color] = ...,
        test_every: int = ...,
    ) -> None: ...
    @staticmethod
    def load(
        folder: _Path,
        *,
        downscale: int = ...,
        background: Optional[_Color] = ...,
        test_every: int = ...,
        normalize: bool = ...,
    ) -> Dataset: ...
    def __copy__(self) -> Dataset: ...
    def __deepcopy__(self, memo: Dict[int, Any]) -> Dataset: ...
    def __len__(self) -> int: ...
    @property
    def cameras(self) -> List[Camera]: ...
    @property
    def background(self) -> Tuple[float, float, float]: ...
    @property
    def warnings(self) -> List[str]: ...
    def photograph(self, index: int) -> _Floats: ...

class Progress:
    def __init__(self, _made_by_the_module: NoReturn) -> None: ...
    @property
    def stage(self) -> str: ...
    @property
    def iteration(self) -> int: ...
    @property
    def iterations(self) -> int: ...
    @property
    def loss(self) -> float: ...
    @property
    def psnr(self) -> float: ...
    @property
    def gaussians(self) -> int: ...
    @property
    def seconds_left(self) -> float: ...

class Trainer:
    def __init__(
        self,
        dataset: Dataset,
        preset: str = ...,
        start: Union[Model, Literal["points", "random"], None] = ...,
        **settings: _Value,
    ) -> None: ...
    def step(self) -> bool: ...
    @property
    def progress(self) -> Progress: ...
    @property
    def warnings(self) -> List[str]: ...
    def model(self) -> Model: ...

class ViewScore:
    def __init__(self, _made_by_the_module: NoReturn) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def psnr(self) -> float: ...
    @property
    def ssim(self) -> float: ...
    @property
    def flip(self) -> Optional[float]: ...

class Evaluation:
    def __init__(self, _made_by_the_module: NoReturn) -> None: ...
    @property
    def views(self) -> List[ViewScore]: ...
    @property
    def mean(self) -> ViewScore: ...
    @property
    def background(self) -> Tuple[float, float, float]: ...
    @property
    def warnings(self) -> List[str]: ...

def evaluate(
    model: Model,
    dataset: Dataset,
    *,
    split: _Split = ...,
    flip: bool = ...,
    textures: _TextureMode = ...,
    progress: Optional[Callable[[int, int], object]] = ...,
) -> Evaluation: ...

class ConvertReport:
    def __init__(self, _made_by_the_module: NoReturn) -> None: ...
    @property
    def input_format(self) -> str: ...
    @property
    def output_format(self) -> str: ...
    @property
    def input_bytes(self) -> int: ...
    @property
    def output_bytes(self) -> int: ...
    @property
    def gaussians(self) -> int: ...
    @property
    def steps(self) -> Optional[float]: ...
    @property
    def psnr(self) -> Optional[float]: ...
    @property
    def warnings(self) -> List[str]: ...

def convert(
    input: _Path,
    output: _Path,
    *,
    overwrite: bool = ...,
    quantize: bool = ...,
    meshopt: bool = ...,
    measure: bool = ...,
    steps: Optional[float] = ...,
    edits: Sequence[Tuple[str, _Value]] = ...,
    target_size: Optional[int] = ...,
    target_psnr: Optional[float] = ...,
    texture_step: Optional[float] = ...,
    cameras: bool = ...,
    views: Sequence[Camera] = ...,
    base_only: bool = ...,
    lean: bool = ...,
    atlas: Optional[Literal["png8", "png16", "exr", "webp"]] = ...,
    spz_version: Optional[int] = ...,
    spz_axes: Optional[Literal["rub", "rdf"]] = ...,
    viewer: Optional[Literal["three", "playcanvas", "babylon", "cesium", "spark"]] = ...,
    viewer_aim: Optional[Literal["textures", "base"]] = ...,
    dry_run: bool = ...,
    progress: Optional[Callable[[str, int, int], object]] = ...,
) -> ConvertReport: ...

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Python module on small scenes: module_test.py FOLDER MAKE_SAMPLE..., FOLDER the package's, MAKE_SAMPLE a command
that writes a data set. Exit code 77: NumPy is missing."""
import ast
import concurrent.futures
import copy
import decimal
import functools
import inspect
import os
import pathlib
import pickle
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import unittest
import warnings

FOLDER, MAKE_SAMPLE = sys.argv[1], sys.argv[2:]
SAMPLE = "docs/sample.tgz"

try:
    import numpy as np
except ImportError:
    print("skipped: no NumPy for " + sys.executable + " (package python3-numpy)")
    sys.exit(77)

sys.path.insert(0, FOLDER)
import textured_gaussians as tg  # noqa: E402


class Folder(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = pathlib.Path(self.temporary.name)

    def refused(self, kind, words, call, *arguments, **named):
        with self.assertRaises(tg.Error) as caught:
            call(*arguments, **named)
        self.assertEqual(caught.exception.kind, kind, str(caught.exception))
        self.assertIn(words, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))


class Models(Folder):
    def test_arrays_have_the_shapes_that_are_documented(self):
        model = tg.Model.load(SAMPLE)
        self.assertEqual(len(model), 5000)
        k = (model.sh_degree + 1) ** 2
        shapes = {"means": (5000, 3), "rotations": (5000, 4), "log_scales": (5000, 3), "opacity_logits": (5000,),
                  "sh": (5000, k, 3), "texture_rects": (5000, 3)}
        for name, shape in shapes.items():
            self.assertEqual(getattr(model, name).shape, shape, name)
        self.assertEqual(model.texels.shape, (int(model.texture_rects[:, 1:].prod(axis=1).sum()), 4))
        self.assertEqual(model.means.dtype, np.float32)
        self.assertEqual(model.texture_mode, "rgba")
        self.assertEqual(len(model.background), 3)

    def test_arrays_are_views_that_outlive_the_name_of_their_model_and_cannot_be_written(self):
        model = tg.Model.load(SAMPLE)
        means = model.means
        self.assertFalse(means.flags.owndata)
        expected = means.copy()
        del model
        self.assertTrue((means == expected).all())
        with self.assertRaises(ValueError):
            means[0, 0] = 1

    def test_a_model_of_another_ones_arrays_is_saved_as_the_same_file(self):
        model = tg.Model.load(SAMPLE)
        again = tg.Model(model.means, model.rotations, model.log_scales, model.opacity_logits, model.sh,
                         texture_mode=model.texture_mode, texture_rects=model.texture_rects, texels=model.texels,
                         background=model.background, cameras=model.cameras, intersection=model.intersection,
                         outside=model.outside)
        again.save(self.folder / "a.tgz")
        tg.Model.load(self.folder / "a.tgz").save(str(self.folder / "b.tgz"))
        self.assertEqual((self.folder / "a.tgz").read_bytes(), (self.folder / "b.tgz").read_bytes())
        self.assertTrue((tg.Model.load(self.folder / "a.tgz").texels == model.texels).all())

    def test_arrays_that_make_no_model_are_refused_by_name_and_shape(self):
        good = {"means": np.zeros((2, 3)), "rotations": [[1, 0, 0, 0]] * 2, "log_scales": np.zeros((2, 3)),
                "opacity_logits": np.zeros(2), "sh": np.zeros((2, 4, 3))}
        self.assertEqual(tg.Model(**good).sh_degree, 1)
        for name, value, kind, words in (
                ("means", np.zeros((2, 4)), "usage", "means: expected an array of shape [N, 3], found [2, 4]"),
                ("rotations", np.ones((3, 4)), "usage", "rotations: expected an array of shape [N, 4], found [3, 4]"),
                ("rotations", np.zeros((2, 4)), "bad_data", "rotation"),
                ("means", np.full((2, 3), np.nan), "bad_data", "mean"),
                ("sh", np.zeros((2, 5, 3)), "usage", "sh: expected K of 1, 4, 9 or 16, found 5"),
                ("texture_mode", "rgbx", "usage", 'texture mode: expected one of none, alpha, rgb, rgba, found "rgbx"'),
                ("texture_rects", np.array([[0, 2, 2], [-1, 1, 1]]), "usage", "texture_rects: row 1"),
                ("texture_rects", np.array([[0, 2, 2], [0, 0, 0]]), "bad_data", "texture_mode: none")):
            with self.subTest(name=name):
                self.refused(kind, words, tg.Model, **(good | {name: value}))
        for name, value, words in (
                ("means", "far", "means: expected numbers, found <U3"), ("means", None, "found object"),
                ("means", [[0, 0, 0], [0]], "means: expected numbers, found "),
                ("rotations", np.ones((2, 4), bool), "rotations: expected numbers, found bool"),
                ("means", np.zeros((2, 3), complex), "found complex128"),
                ("log_scales", np.zeros((2, 3), "M8[s]"), "found datetime64[s]"),
                ("sh", [[["1", "2", "3"]]] * 2, "sh: expected numbers, found <U1"),
                ("opacity_logits", np.ma.masked_array(np.zeros(2), mask=[True, False]), "found masked values"),
                ("texels", np.zeros((2, 4), bool), "texels: expected numbers, found bool"),
                ("texture_rects", np.full((2, 3), 2.9), "texture_rects: expected integers, found float64")):
            with self.subTest(name=name, value=value), self.assertRaises(TypeError) as caught:
                tg.Model(**(good | {name: value}))
            self.assertIn(words, str(caught.exception))
        with self.assertRaisesRegex(TypeError, "focal: expected numbers, found <U1"):
            tg.Camera(np.eye(3), (0, 0, 0), ("1", "2"), (1, 1), 2, 2)
        with np.errstate(all="raise"), self.assertRaises(FloatingPointError):
            tg.Model(**(good | {"means": np.full((2, 3), 1e300)}))
        with warnings.catch_warnings(), self.assertRaises(RuntimeWarning):
            warnings.simplefilter("error")
            tg.Model(**(good | {"sh": np.full((2, 4, 3), 1e300)}))
        for raised in KeyboardInterrupt, MemoryError:
            with self.subTest(raised=raised), self.assertRaises(raised):
                tg.Model(**(good | {"means": Raising(raised)}))
        with self.assertRaisesRegex(TypeError, "means: expected numbers, found Raising"):
            tg.Model(**(good | {"means": Raising(ValueError)}))
        plain = tg.Model(**{name: np.asarray(value, "i8") for name, value in good.items()})
        self.assertEqual(plain.texture_rects.shape, (0, 3))
        lists = {name: np.asarray(value).tolist() for name, value in good.items()}
        textured = tg.Model(**lists, texture_mode="rgba", texture_rects=[[0, 1, 1], [0, 0, 0]], texels=[[0, 0, 0, 1]])
        self.assertEqual(textured.texture_rects.tolist(), [[0, 1, 1], [0, 0, 0]])
        self.assertEqual(len(tg.Model(**good, texture_rects=plain.texture_rects, texels=plain.texels)), 2)
        rects, texels = {"texture_rects": [[0, 1, 1], [0, 0, 0]]}, {"texels": [[0, 0, 0, 1]]}
        for words, given in {"texture_mode: none beside texels": rects | texels,
                             "texels: without texture_rects": texels | {"texture_mode": "rgba"},
                             "texture_rects: without texels": rects | {"texture_mode": "rgba"}}.items():
            self.refused("bad_data", words, tg.Model, **good, **given)

    def test_models_are_copied_and_pickled(self):
        model = tg.Model.load(SAMPLE)
        self.assertIs(copy.copy(model), model)
        self.assertIs(copy.deepcopy([model])[0], model)
        texels = model.texels * np.float32(0.3) + np.float32(0.1)  # that a file would round
        exact = tg.Model(model.means, model.rotations, model.log_scales, model.opacity_logits, model.sh,
                         texture_mode="rgb", texture_rects=model.texture_rects, texels=texels, cameras=model.cameras,
                         background=(0.1, 0.2, 0.3), intersection="plane", outside="clip")
        plain = tg.Model([[1, 2, 3]], [[1, 0, 0, 0]], [[0, 0, 0]], [1], [[[1, 1, 1]]])
        for given in exact, plain:
            again = pickle.loads(pickle.dumps(given))
            for name in ("means", "rotations", "log_scales", "opacity_logits", "sh", "texture_rects", "texels"):
                self.assertTrue(np.array_equal(getattr(again, name), getattr(given, name)), name)
            for name in ("texture_mode", "background", "cameras", "intersection", "outside", "sh_degree"):
                self.assertEqual(getattr(again, name), getattr(given, name), name)

    def test_every_protocol_pickles(self):
        run = subprocess.run([sys.executable, "-c", """
import pickle, sys, numpy as np, textured_gaussians as tg
model, plain = tg.Model.load(sys.argv[1]), tg.Model([[1, 2, 3]], [[1, 0, 0, 0]], [[0, 0, 0]], [1], [[[1, 1, 1]]])
for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
    again, camera, error = pickle.loads(pickle.dumps((plain, model.cameras[0], tg.Error("text")), protocol))
    assert np.array_equal(again.means, plain.means) and camera == model.cameras[0] and str(error) == "text"
    try:
        pickle.dumps(tg.Renderer(plain), protocol)
    except TypeError as error:
        assert "pickle" in str(error), error
    else:
        assert False
    for function in tg.evaluate, tg.Model.load, tg.Renderer.render:
        assert pickle.loads(pickle.dumps(function, protocol)) is function
""", SAMPLE], env=os.environ | {"PYTHONPATH": FOLDER}, capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))

    def test_files_that_are_none_are_refused_with_their_kind(self):
        self.refused("cannot_read", "none.tgz", tg.Model.load, self.folder / "none.tgz")
        self.refused("cannot_read", os.fsdecode(b"n\xf6ne.tgz"), tg.Model.load, os.fsdecode(b"n\xf6ne.tgz"))
        (self.folder / "bad.tgz").write_bytes(b"\x1f\x8b, but not quite")
        self.refused("bad_data", "bad.tgz", tg.Model.load, self.folder / "bad.tgz")
        model = tg.Model.load(SAMPLE)
        self.refused("usage", "a.xyz", model.save, self.folder / "a.xyz")
        self.refused("usage", "is no model format", model.save, self.folder / "a.png")
        self.assertTrue(any("texture" in line for line in model.save(self.folder / "a.ply")))
        self.assertTrue(issubclass(tg.Error, RuntimeError))

    def test_names_that_are_no_utf8_are_told_and_taken_as_others(self):
        name = os.fsdecode(b"n\xf6me")
        model = tg.Model.load(SAMPLE)
        model.save(self.folder / name / "lod-meta.json")
        (self.folder / name / "0/cameras.json").write_text("{")
        warned = tg.Model.load(self.folder / name / "lod-meta.json").warnings
        self.assertTrue(any(name in line for line in warned), warned)
        report = tg.convert(self.folder / name / "lod-meta.json", self.folder / "a.ply")
        self.assertTrue(any(name in line for line in report.warnings), report.warnings)
        model.save(self.folder / (name + ".tgz"))
        other = str(self.folder / (name + ".tgz"))
        both = tg.convert(SAMPLE, self.folder / "b.ply", edits=[("--merge", other)])
        self.assertEqual(both.gaussians, 10000)
        for value in (os.fsencode(other), pathlib.Path(other)):
            merged = tg.convert(SAMPLE, self.folder / "b.ply", overwrite=True, edits=[("merge", value)])
            self.assertEqual(merged.gaussians, 10000)
        self.refused("usage", name, tg.convert, SAMPLE, self.folder / "c.ply", edits=[("scale", name)])
        self.refused("usage", "merge: a name holds a NUL byte", tg.convert, SAMPLE, self.folder / "c.ply",
                     edits=[("merge", b"a\0b")])

    def test_edits_take_numbers_as_settings_do(self):
        files = []
        for name, values in {"a.ply": ("2.5", "100"), "b.ply": (2.5, 100),
                             "c.ply": (np.float32(2.5), np.int64(100))}.items():
            tg.convert(SAMPLE, self.folder / name, edits=list(zip(("scale", "decimate"), values)))
            files.append((self.folder / name).read_bytes())
        self.assertEqual(files, files[:1] * 3)
        self.refused("usage", "upright: takes no value", tg.convert, SAMPLE, self.folder / "d.ply",
                     edits=[("upright", 1)])


class Refusals(Folder):
    def test_arguments_of_wrong_types_are_named_and_not_printed(self):
        content = pathlib.Path(SAMPLE).read_bytes()
        many, camera = np.zeros(100000), tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        renderer = tg.Renderer(tg.Model.load(SAMPLE))
        for end, call, given, named in (
                ("Found: bytes", tg.Renderer, (content,), {}),
                ("Found: nothing", tg.Model, (), {}),
                ("Found: ndarray, size=bytes", renderer.render, (many,), {"size": content}),
                ("Found: Camera, max_sh_degree=str", renderer.render, (camera,), {"max_sh_degree": "x" * 100000}),
                ("Found: bytes, ndarray", tg.evaluate, (content, many), {}),
                ("Found: list[int]", tg.set_threads, ([0] * 100000,), {}),
                ("Found: list[ndarray], list[Camera | NoneType]", tg.Dataset, ([many] * 2, [camera, None]), {}),
                ("Found: list, tuple[int | str | float | ...]", tg.Dataset, ([], (1, "2", 3.0, 4, None)), {}),
                ("Found: " + "str, " * 20 + "...", tg.set_threads, ["x"] * 10000, {}),
                ("Found: str, downscale=str", tg.Dataset.load, ("scene",), {"downscale": "2"})):
            with self.subTest(end=end), self.assertRaises(TypeError) as caught:
                call(*given, **named)
            said = str(caught.exception)
            self.assertTrue(said.endswith("\n" + end), said[-200:])
            self.assertIn("The following argument types are supported:\n    1. ", said)
            self.assertLess(len(said), 3000)

    def test_integers_out_of_range_are_named(self):
        dataset = tg.Dataset([np.zeros((3, 4))], [tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)])
        for index in -1, np.int64(-1):
            self.refused("usage", "photograph: no such one (expected 0 to 0, found -1)", dataset.photograph, index)
        for end, call, given, named in (
                ("int 9223372036854775808", dataset.photograph, (1 << 63,), {}),
                ("int of 33220 bits", dataset.photograph, (10 ** 10000,), {}),
                ("str, str, target_size=int -1", tg.convert, (SAMPLE, "a.ply"), {"target_size": -1}),
                ("bool, int 1, int 2147483648", tg.look_at, (True, 1, 1 << 31), {}),
                ("tuple[int], tuple[int], tuple[int], float, int64 1099511627776, int 3", tg.look_at,
                 ((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, np.int64(1 << 40), 3), {}),
                ("uint64 9223372036854775808", dataset.photograph, (np.uint64(1 << 63),), {})):
            with self.subTest(end=end), self.assertRaises(TypeError) as caught:
                call(*given, **named)
            self.assertEqual(str(caught.exception).rpartition("\nFound: ")[2], end)

    def test_type_errors_of_code_that_is_called_are_that_codes_own(self):
        said = "f(): incompatible function arguments\nInvoked with: 1"  # as another module of pybind11's has it

        def pictures():
            raise TypeError(said)
            yield

        try:
            tg.Dataset(pictures(), [])
        except TypeError as error:
            self.assertEqual(str(error), said)
            self.assertEqual(traceback.extract_tb(error.__traceback__)[-1].name, "pictures")
        else:
            self.fail("accepted")

        class Silent(TypeError):
            def __str__(self):
                raise ZeroDivisionError

        def silent(*_):
            raise Silent

        model = tg.Model.load(SAMPLE)
        dataset = tg.Dataset([np.zeros((3, 4))], [tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)])
        with self.assertRaises(Silent):
            tg.evaluate(model, dataset, split="train", progress=silent)
        # As functions and classes of other modules of pybind11's are, without a frame of Python's own.
        read = tg.read_image.__wrapped__
        with self.assertRaises(TypeError) as caught:
            tg.evaluate(model, dataset, split="train", progress=read)
        self.assertRegex(str(caught.exception), r"^read_image\(\): [^\0]*\nInvoked with: 1, 1$")
        make = functools.partial(tg.Renderer.__init__.__wrapped__, tg.Renderer.__new__(tg.Renderer))
        with self.assertRaises(TypeError) as caught:
            tg.Dataset(map(make, ["x"]), dataset.cameras)
        self.assertIn("Renderer(model: ", str(caught.exception))
        self.assertIn("Invoked with: ", str(caught.exception))

    def test_objects_that_were_not_made_hold_nothing(self):
        run = subprocess.run([sys.executable, "-c", """
import inspect, pickle, sys, traceback, unittest.mock, textured_gaussians as tg

def refused(call, *arguments, **named):
    try:
        found = call(*arguments, **named)
    except TypeError as error:
        return str(error)
    raise AssertionError(f"{call} gave {found}")

def unmade(kind):
    return kind.__new__(kind)

for kind in (getattr(tg, name) for name in tg.__all__ if isinstance(getattr(tg, name), type)):
    if kind is tg.Error:
        continue
    name = kind.__name__
    if "__repr__" in vars(kind):
        assert repr(unmade(kind)) == f"<{name} that was not made>", repr(unmade(kind))
    else:
        assert repr(unmade(kind)).startswith("<"), repr(unmade(kind))
    for member in (each for each, found in vars(kind).items() if inspect.isdatadescriptor(found) and each[0] != "_"):
        assert refused(getattr, unmade(kind), member).startswith(f"{name}: "), member
    refused(pickle.dumps, unmade(kind))
camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
said = "Model: expected an object that is made (its __init__ has not run, or has failed)"
assert refused(len, unmade(tg.Model)) == refused(tg.Renderer, unmade(tg.Model)) == said
model = tg.Model([[1, 2, 3]], [[1, 0, 0, 0]], [[0, 0, 0]], [1], [[[1, 1, 1]]])
refused(tg.Model, model.means, model.rotations, model.log_scales, model.opacity_logits, model.sh,
        cameras=[unmade(tg.Camera)])
refused(tg.Renderer(model).render, unmade(tg.Camera))
refused(unmade(tg.Renderer).render, camera)
refused(tg.Trainer, unmade(tg.Dataset))
refused(unmade(tg.Trainer).step)
refused(hash, unmade(tg.Camera))
refused(lambda: camera == unmade(tg.Camera))
mock = unittest.mock.Mock(spec=tg.Model)  # whose __class__ is Model
refused(tg.Renderer, mock)
assert refused(tg.Model.__repr__, mock) == "Model: expected an object of this class, found Mock"
assert refused(tg.Model.__repr__, 5) == "Model: expected an object of this class, found int"

class Mine(tg.Model):
    def __init__(self):
        self.text = repr(self)
        super().__init__(model.means, model.rotations, model.log_scales, model.opacity_logits, model.sh)

assert Mine().text == "<Model that was not made>" and len(Mine()) == 1
for call in lambda: tg.Model(1, 2, 3, 4, 5), lambda: tg.Camera(1, 2, 3, 4, 5, 6):
    try:
        call()
    except (tg.Error, TypeError):
        shown = traceback.TracebackException(*sys.exc_info(), capture_locals=True)
        assert "that was not made>" in "".join(shown.format())
"""], env=os.environ | {"PYTHONPATH": FOLDER}, capture_output=True, text=True)
        self.assertEqual((run.returncode, run.stderr), (0, ""))

    def test_long_texts_are_quoted_by_their_beginnings_and_ends(self):
        long = "x" * 100000
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        dataset, model = tg.Dataset([np.zeros((3, 4))], [camera]), tg.Model.load(SAMPLE)
        for begin, call, given, named in (
                ("--preset: expected default, quick, paper, found", tg.Trainer, (dataset, long), {}),
                ("--iterations: ", tg.Trainer, (dataset,), {"iterations": long}),
                ("--iterations: ", tg.Trainer, (dataset,), {"iterations": "9" * 100000}),
                ("xxx", tg.Trainer, (dataset,), {long: 1}),
                ("xxx", tg.Trainer, (dataset,), {long + "_": 1, long + "-": 2}),
                ("xxx", tg.Trainer, (dataset,), {long: 1, "--" + long: 2}),
                ("xxx", tg.convert, (SAMPLE, "a.ply"), {"edits": [(long, 1)]}),
                ("--scale ", tg.convert, (SAMPLE, "a.ply"), {"edits": [("scale", long)]}),
                ("upright: takes no value", tg.convert, (SAMPLE, "a.ply"), {"edits": [("upright", long)]}),
                ("--atlas: ", tg.convert, (SAMPLE, "a.glb"), {"atlas": long}),
                ("--spz-axes: ", tg.convert, (SAMPLE, "a.ply"), {"spz_axes": long}),
                ("--for: ", tg.convert, (SAMPLE, "a.splat"), {"viewer": long}),
                ("--for-aim: ", tg.convert, (SAMPLE, "a.splat"), {"viewer": "three", "viewer_aim": long}),
                ("split: expected one of test, train, all, found", tg.evaluate, (model, dataset), {"split": long}),
                ("texture mode: expected one of ", tg.evaluate, (model, dataset), {"textures": long})):
            with self.subTest(begin=begin, named=list(named)), self.assertRaises(tg.Error) as caught:
                call(*given, **named)
            said = str(caught.exception)
            self.assertEqual(said[:len(begin)], begin)
            self.assertRegex(said, r"(x\.\.\.x|9\.\.\.9)")
            self.assertLess(len(said), 600)
        with self.assertRaises(tg.Error) as caught:
            tg.write_image("a." + "y" * 4000, np.zeros((2, 2)))
        self.assertEqual(str(caught.exception).count("y" * 100), 40)

    def test_settings_are_texts_numbers_and_truths(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        dataset = tg.Dataset([np.zeros((3, 4))], [camera])
        for value in decimal.Decimal(3), np.array([3]), np.array(3), np.str_("3"), np.bytes_(b"3"):
            self.assertEqual(tg.Trainer(dataset, iterations=value).progress.iterations, 3)
        for value, kind in (([0] * 300000, "list"), (None, "NoneType"), (np.zeros(3), "ndarray"), ({}, "dict"),
                            (np.datetime64("2020-01-01"), "date"), (np.array([None]), "NoneType")):
            with self.subTest(kind=kind):
                words = f": expected a text, a number or a truth, found {kind}$"
                self.assertRaisesRegex(TypeError, "^texture-size" + words, tg.Trainer, dataset, texture_size=value)
                self.assertRaisesRegex(TypeError, "^scale" + words, tg.convert, SAMPLE, "a.ply",
                                       edits=[("scale", value)])
        with self.assertRaises(KeyboardInterrupt):
            tg.Trainer(dataset, iterations=Item(KeyboardInterrupt))

    def test_what_names_no_file_is_refused_by_its_type(self):
        content, picture = pathlib.Path(SAMPLE).read_bytes(), np.zeros((2, 2))
        for words, call, given in (
                ("path: expected a file's name, found bytes", tg.Model.load, (content,)),
                ("path: expected a file's name, found int", tg.Model.load, (3,)),
                ("path: expected a file's name, found NoneType", tg.Model.load(SAMPLE).save, (None,)),
                ("path: expected a file's name, found ndarray", tg.read_image, (picture,)),
                ("path: expected a file's name, found ndarray", tg.write_image, (picture, picture)),
                ("folder: expected a file's name, found list", tg.Dataset.load, (["scene"],)),
                ("input: expected a file's name, found Model", tg.convert, (tg.Model.load(SAMPLE), "a.ply")),
                ("output: expected a file's name, found float", tg.convert, (SAMPLE, 2.0))):
            with self.subTest(words=words, call=call), self.assertRaises(TypeError) as caught:
                call(*given)
            self.assertEqual(str(caught.exception), words)
        self.refused("usage", "path: a name of 100000 bytes", tg.Model.load, "x" * 100000)


class Convertible:
    """As pictures of PIL's and tensors are: no array, but one can be made of it."""

    def __init__(self, array):
        self.array = array

    def __array__(self, *_, **__):
        return self.array


class Pictured(Convertible):
    """As pictures of PIL's."""

    def __init__(self, mode, array):
        super().__init__(array)
        self.mode = mode

    def convert(self, mode):
        return self


class Item:
    """Is a number of another library's."""

    dtype = None

    def __init__(self, error):
        self.error = error

    def item(self):
        raise self.error


class Raising:
    """Is no array."""

    def __init__(self, error):
        self.error = error

    def __array__(self, *_, **__):
        raise self.error


class Pictures(Folder):
    def test_pictures_have_the_shape_of_camera_and_output(self):
        renderer = tg.Renderer(tg.Model.load(SAMPLE))
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 40, 30)
        picture = renderer.render(camera)
        self.assertEqual((picture.shape, picture.dtype), ((30, 40, 3), np.float32))
        parts = renderer.render(camera, "base") + renderer.render(camera, "texture")
        np.testing.assert_allclose(picture, parts, atol=1e-5)
        self.assertEqual(renderer.render(camera, "depth").shape, (30, 40))
        alpha = renderer.render(camera, output="alpha")
        red = renderer.render(camera, background=(1, 0, 0))
        self.assertTrue((alpha == 0).any())
        self.assertTrue((red[alpha == 0] == (1, 0, 0)).all())
        self.assertGreater(np.abs(picture - renderer.render(camera, textures="none")).max(), 0.01)
        self.refused("usage", "output: expected one of final", renderer.render, camera, "colour")
        self.refused("usage", 'found "a?b?[31m"', renderer.render, camera, "a\nb\x1b[31m")
        self.refused("usage", "splat", renderer.render, camera, splat_scale=-1)

    def test_a_camera_projects_as_its_documentation_says(self):
        camera = tg.look_at((1, 2, -4), (0, 0, 0), (0, -1, 0), 0.8, 80, 60)
        point = np.array([0.3, -0.2, 0.1])
        x, y, z = camera.rotation @ point + camera.translation
        where = np.array([x / z, y / z]) * camera.focal + camera.center
        model = tg.Model([point], [[1, 0, 0, 0]], [[-2, -2, -2]], [8], [[[1, 1, 1]]])
        alpha = tg.Renderer(model).render(camera, "alpha")
        row, column = np.unravel_index(alpha.argmax(), alpha.shape)
        self.assertEqual((column, row), tuple(where.astype(int)))
        again = tg.Camera(camera.rotation, camera.translation, camera.focal, camera.center, 80, 60, name="a")
        self.assertTrue((tg.Renderer(model).render(again, "alpha") == alpha).all())
        bad = tg.Camera(2 * camera.rotation, camera.translation, camera.focal, camera.center, 80, 60, "a")
        self.refused("usage", "camera a: the rotation's rows", tg.Renderer(model).render, bad)
        self.refused("usage", "rotation: expected an array of shape [3, 3]", tg.Camera, np.eye(4), (0, 0, 0), (1, 1),
                     (1, 1), 2, 2)

    def test_memory_that_is_not_there_is_told_in_words(self):
        if "asan" in os.environ.get("LD_PRELOAD", ""):
            self.skipTest("AddressSanitizer needs an address space without a limit")
        run = subprocess.run([sys.executable, "-c", """
import resource, sys, textured_gaussians as tg
renderer = tg.Renderer(tg.Model.load(sys.argv[1]))
camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 16000, 16000)
resource.setrlimit(resource.RLIMIT_AS, (1 << 31, resource.RLIM_INFINITY))
renderer.render(camera)
""", SAMPLE], env=os.environ | {"PYTHONPATH": FOLDER}, capture_output=True, text=True)
        self.assertEqual(run.stderr.splitlines()[-1],
                         "MemoryError: the memory that the system grants this process is not enough")

    def test_cameras_are_compared_copied_and_pickled(self):
        model = tg.Model.load(SAMPLE)
        camera = model.cameras[0]
        self.assertEqual(camera, model.cameras[0])
        self.assertNotEqual(camera, model.cameras[1])
        self.assertEqual(len({camera, copy.deepcopy(camera), pickle.loads(pickle.dumps(camera))}), 1)
        with self.assertRaises(ValueError):
            camera.rotation[0, 0] = 7
        named = tg.Camera(np.eye(3), (0, 0, 0), (1, 1), (1, 1), 2, 2, name="a\nb", test=True)
        self.assertEqual(repr(named), "<Camera 'a\\nb' 2 x 2, held out>")
        name = os.fsdecode(b"n\xf6ne.png")  # as of a COLMAP folder from another system
        foreign = tg.Camera(np.eye(3), (0, 0, 0), (1, 1), (1, 1), 2, 2, name)
        self.assertEqual((foreign.name, pickle.loads(pickle.dumps(foreign)).name), (name, name))
        self.assertTrue(repr(foreign).isprintable())

    def test_several_threads_may_use_one_renderer(self):
        renderer = tg.Renderer(tg.Model.load(SAMPLE))
        cameras = [tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, width, 30) for width in (40, 90, 64, 120)]
        alone = [renderer.render(camera) for camera in cameras]
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            together = list(pool.map(renderer.render, 8 * cameras))
        for i, picture in enumerate(together):
            self.assertTrue((picture == alone[i % 4]).all())

    def test_an_image_survives_a_file(self):
        image = np.linspace(0, 1, 2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3)
        tg.write_image(self.folder / "a.png", image)
        np.testing.assert_allclose(tg.read_image(self.folder / "a.png"), image, atol=0.5 / 255 + 1e-6)
        tg.write_image(self.folder / "grey.png", image[:, :, 0])
        self.assertEqual(tg.read_image(self.folder / "grey.png").shape, (2, 3))
        with self.assertRaisesRegex(TypeError, "image: expected floats, black 0 and white 1, found uint8"):
            tg.write_image(self.folder / "a.png", np.full((2, 2, 3), 100, np.uint8))
        self.refused("cannot_write", "a.exr: ", tg.write_image, self.folder / "a.exr", np.full((2, 2), 1e5))
        self.refused("usage", "a.jpg: 8 bits hold finite numbers alone (found inf at column 0, row 0)", tg.write_image,
                     self.folder / "a.jpg", np.full((2, 2), np.inf))
        self.refused("usage", "found [2]", tg.write_image, self.folder / "a.png", np.zeros(2))
        self.refused("usage", "no picture", tg.write_image, self.folder / "a.png", np.zeros((2, 2, 7)))

    def test_other_threads_go_on_while_a_picture_is_drawn(self):
        renderer = tg.Renderer(tg.Model.load(SAMPLE))
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 400, 400)
        done, counted = threading.Event(), []

        def count():
            while not done.is_set():
                counted.append(1)
                time.sleep(0)

        other = threading.Thread(target=count)
        other.start()
        interval = sys.getswitchinterval()
        try:
            sys.setswitchinterval(100)  # nobody is made to let others go on: whoever lets them does so
            before = len(counted)
            for _ in range(100):  # a busy machine may not come to the other thread during one picture
                renderer.render(camera)
                if len(counted) > before:
                    break
            self.assertGreater(len(counted), before)
        finally:
            sys.setswitchinterval(interval)
            done.set()
            other.join()


class Training(Folder):
    @classmethod
    def setUpClass(cls):
        cls.scene = tempfile.TemporaryDirectory()
        subprocess.run([*MAKE_SAMPLE, cls.scene.name, "--size", "32", "--views", "6", "--test-views", "2",
                        "--points", "300", "--overwrite"], check=True, stdout=subprocess.DEVNULL)

    @classmethod
    def tearDownClass(cls):
        cls.scene.cleanup()

    def test_training_learns_and_does_not_depend_on_threads(self):
        dataset = tg.Dataset.load(self.scene.name)
        self.assertEqual(len(dataset), 8)
        self.assertEqual([camera.test for camera in dataset.cameras], [False] * 6 + [True] * 2)
        self.assertEqual(dataset.photograph(0).shape, (32, 32, 3))
        self.refused("usage", "found 8", dataset.photograph, 8)
        files = []
        for threads in (1, 2):
            tg.set_threads(threads)
            trainer = tg.Trainer(dataset, iterations=150, texture_iterations=20, texture_size=2, sh_degree=1,
                                 compare_untextured=False)
            before = tg.evaluate(trainer.model(), dataset, split="train").mean.psnr
            steps = 0
            while trainer.step():
                steps += 1
            self.assertEqual(steps, 170)
            self.assertEqual((trainer.progress.stage, trainer.progress.iteration), ("textured", 20))
            self.assertEqual(trainer.progress.gaussians, len(trainer.model()))
            after = tg.evaluate(trainer.model(), dataset, split="train", flip=True)
            self.assertGreater(after.mean.psnr, before + 1)
            self.assertEqual(len(after.views), 6)
            self.assertAlmostEqual(after.mean.ssim, sum(view.ssim for view in after.views) / 6)
            self.assertTrue(0 < after.mean.flip < 1)
            trainer.model().save(self.folder / "model.tgz")
            files.append((self.folder / "model.tgz").read_bytes())
        tg.set_threads(0)
        self.assertEqual(*files)

    def test_a_training_may_be_watched_by_another_thread_and_get_more_threads(self):
        self.addCleanup(tg.set_threads, 0)
        dataset = tg.Dataset.load(self.scene.name)
        trainer = tg.Trainer(dataset, iterations=np.int64(40), texture_mode="none", compare_untextured=np.bool_(False))
        self.assertEqual((trainer.progress.psnr, trainer.progress.iteration), (0, 0))
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            def steps():
                return sum(iter(trainer.step, False))
            done = [pool.submit(steps), pool.submit(steps)]
            sizes = pool.submit(lambda: [len(trainer.model()) for _ in range(20)] + [trainer.progress.gaussians])
            changes = pool.submit(lambda: [tg.set_threads(1 + i % 4) for i in range(10000)])
            self.assertEqual(sum(each.result() for each in done), 40)
            self.assertEqual(len(changes.result()), 10000)
            self.assertTrue(all(size > 0 for size in sizes.result()))
        self.assertRegex(repr(trainer.progress), r"<Progress plain 40 of 40, \d+ Gaussians, \d+\.\d\d dB>")

    def test_an_evaluation_goes_over_the_background_of_the_model(self):
        black = tg.Dataset.load(self.scene.name, background=(0, 0, 0))
        model = tg.Trainer(black, iterations=1, texture_mode="none").model()
        found = tg.evaluate(model, tg.Dataset.load(self.scene.name))
        self.assertEqual((found.background, found.warnings), ((0, 0, 0), []))
        self.assertEqual(found.mean.psnr, tg.evaluate(model, black).mean.psnr)
        told = []
        tg.evaluate(model, black, split="train", progress=lambda done, of: told.append((done, of)))
        self.assertEqual(told, [(done, 6) for done in range(1, 7)])
        with self.assertRaises(ZeroDivisionError):
            tg.evaluate(model, black, progress=lambda done, of: done // 0)
        self.assertIn("none of its 72 cameras", tg.evaluate(tg.Model.load(SAMPLE), black).warnings[0])

    def test_arrays_train_as_the_files_that_hold_them(self):
        loaded = tg.Dataset.load(self.scene.name, background=(0, 0, 0))
        folder = pathlib.Path(self.scene.name)
        pictures = [tg.read_image(folder / ("test" if camera.test else "train") / camera.name)
                    for camera in loaded.cameras]
        cloud = (folder / "points3d.ply").read_bytes().split(b"end_header\n")[1]
        points = np.frombuffer(cloud, [("xyz", "<f4", 3), ("rgb", "u1", 3)])
        data = {"points": points["xyz"], "background": (0, 0, 0)}
        bytes_of = [np.round(picture * 255).astype(np.uint8) for picture in pictures]
        models = []
        for dataset in (loaded, tg.Dataset(pictures, loaded.cameras, **data, colors=points["rgb"] / np.float32(255)),
                        tg.Dataset(iter(bytes_of), loaded.cameras, **data, colors=points["rgb"], masks=[None] * 8)):
            trainer = tg.Trainer(dataset, iterations=10, texture_iterations=5, texture_size=2)
            while trainer.step():
                pass
            trainer.model().save(self.folder / "model.tgz")
            models.append((self.folder / "model.tgz").read_bytes())
            self.assertEqual(repr(tg.evaluate(trainer.model(), dataset)), repr(tg.evaluate(trainer.model(), loaded)))
        self.assertEqual(models[0], models[1])
        self.assertEqual(models[0], models[2])

    def test_arrays_that_make_no_data_set_are_refused_in_words(self):
        cameras = [tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)] * 2
        images = [np.full((3, 4, 3), 0.5)] * 2
        named = tg.Dataset(images, cameras, names=["b", "a"], test_every=2)
        self.assertEqual([(camera.name, camera.test) for camera in named.cameras], [("b", False), ("a", True)])
        paths = tg.Dataset(images, cameras, names=[pathlib.Path("b"), b"a"])
        self.assertEqual([camera.name for camera in paths.cameras], ["b", "a"])
        self.assertEqual(named.photograph(0)[0, 0].tolist(), [np.float32(128 / 255)] * 3)
        self.assertEqual(len(tg.Dataset(np.full((2, 3, 4), 0.5), cameras, masks=[np.eye(3, 4) > 0, None],
                                        points=[[0, 0, 0]], colors=np.full((1, 3), 255, np.uint8))), 2)
        for kind, words, given in (
                ("bad_data", "data set: cameras: wrong length (expected 1, found 2)", (images[:1], cameras)),
                ("bad_data", "data set: image 0: no picture of its camera's size", (np.zeros((2, 4, 3)), cameras)),
                ("usage", "images: more than cameras (expected 2)", (images * 2, cameras)),
                ("usage", "image 1: expected an array of shape [height, width]", ([images[0], np.zeros(3)], cameras)),
                ("usage", "data set: image 1: 8 bits hold finite numbers alone (found nan",
                 ([images[0], np.full((3, 4, 3), np.nan)], cameras))):
            with self.subTest(words=words):
                self.refused(kind, words, tg.Dataset, *given)
        for kind, words, given in (
                ("usage", "names: expected one a camera, 2, found 1", {"names": ["a"]}),
                ("usage", "masks: more than cameras (expected 2)", {"masks": [None] * 3}),
                ("usage", "mask 0: expected an array of shape [height, width], found", {"masks": [images[0] > 0] * 2}),
                ("bad_data", "data set: mask 0: hides every pixel", {"masks": [np.zeros((3, 4), bool), None]}),
                ("usage", "points: expected an array of shape [P, 3]", {"points": np.zeros((3, 4))}),
                ("bad_data", "colors: wrong length", {"points": np.zeros((3, 3)), "colors": np.zeros((2, 3))}),
                ("usage", "--test-every: out of range", {"test_every": 1})):
            with self.subTest(words=words):
                self.refused(kind, words, tg.Dataset, images, cameras, **given)
        unread = iter(images)
        self.refused("usage", "names: expected one", tg.Dataset, unread, cameras, names=["a"])
        self.assertEqual(len(list(unread)), 2)
        for words, given in (("image 0: expected uint8", {"images": np.zeros((2, 3, 4), np.int64)}),
                             ("mask 1: expected truths or uint8, found", {"masks": [None, np.ones((3, 4))]}),
                             ("colors: expected uint8", {"points": [[0, 0, 0]], "colors": [[255, 0, 0]]})):
            with self.subTest(words=words), self.assertRaisesRegex(TypeError, words):
                tg.Dataset(**({"images": images, "cameras": cameras} | given))

    def test_what_numpy_makes_arrays_of_is_taken_by_the_type_of_the_array(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        image = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
        dataset = tg.Dataset([Convertible(image)], [camera], masks=[Convertible(image[:, :, 0])], points=[[0, 0, 0]],
                             colors=Convertible(image[0, :1]))
        self.assertEqual(dataset.photograph(0).tolist(), (image / np.float32(255)).tolist())
        self.assertEqual(len(tg.Dataset([Convertible(image / 255)], [camera], masks=[Convertible(image[..., 0] > 0)])),
                         1)
        for words, given in (("image 0: expected uint8, .* found int64", {"images": [Convertible(image.astype("i8"))]}),
                             ("mask 0: .* found float64", {"masks": [Convertible(np.ones((3, 4)))]}),
                             ("image 0: .* found masked", {"images": [np.ma.masked_array(image)]})):
            with self.subTest(words=words), self.assertRaisesRegex(TypeError, words):
                tg.Dataset(**({"images": [image], "cameras": [camera]} | given))

    def test_pictures_are_taken_by_their_mode(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        flat, deep = np.full((3, 4), 51, np.uint8), np.full((3, 4, 4), 51, np.uint8)
        for mode, array in (("L", flat), ("RGB", deep[..., :3]), ("RGBA", deep), ("F", flat / np.float32(255))):
            dataset = tg.Dataset([Pictured(mode, array)], [camera], masks=[Pictured("1", flat > 0)])
            self.assertEqual(dataset.photograph(0).shape, (3, 4, 3))
        for mode, array, kept in (("P", flat, "RGB"), ("CMYK", deep, "RGB"), ("YCbCr", deep[..., :3], "RGB"),
                                  ("HSV", deep[..., :3], "RGB"), ("LAB", deep[..., :3], "RGB"), ("RGBX", deep, "RGB"),
                                  ("RGBa", deep, "RGBA"), ("LA", deep[..., :2], "RGBA"), ("PA", deep, "RGBA")):
            with self.subTest(mode=mode), self.assertRaises(TypeError) as caught:
                tg.Dataset([Pictured(mode, array)], [camera])
            self.assertEqual(str(caught.exception), "image 0: expected a picture of mode L, RGB or RGBA, found "
                                                    f'{mode} (convert("{kept}"))')
        for mode, advice in ("P", ' (convert("L"))'), ("PA", ' (convert("L"))'), ("LAB", ""), ("La", ""):
            with self.subTest(mode=mode), self.assertRaises(TypeError) as caught:
                tg.Dataset([flat], [camera], masks=[Pictured(mode, deep)])
            self.assertEqual(str(caught.exception), f"mask 0: expected a picture of mode 1 or L, found {mode}{advice}")
        with self.assertRaisesRegex(TypeError, "^image 0: expected a picture of mode L, RGB or RGBA, found La$"):
            tg.Dataset([Pictured("La", deep[..., :2])], [camera])  # of which Pillow makes LA alone
        for told, kept in (({"has_transparency_data": True}, "RGBA"), ({"has_transparency_data": False}, "RGB"),
                           ({"info": {"transparency": 0}}, "RGBA"), ({"info": {"gamma": 1}}, "RGB")):
            palette = Pictured("P", flat)
            vars(palette).update(told)
            with self.subTest(told=told), self.assertRaises(TypeError) as caught:
                tg.Dataset([palette], [camera])
            self.assertTrue(str(caught.exception).endswith(f'found P (convert("{kept}"))'), str(caught.exception))
        for mode, array, found in (("I;16", flat.astype("u2"), "uint16"), ("1", flat > 0, "bool")):
            with self.assertRaisesRegex(TypeError, f"image 0: expected uint8, .* found {found}"):
                tg.Dataset([Pictured(mode, array)], [camera])
        deep.tofile(self.folder / "bytes")  # whose mode is another one
        mapped = np.memmap(self.folder / "bytes", np.uint8, "r", shape=deep.shape)
        self.assertEqual(len(tg.Dataset([mapped], [camera])), 1)

    def test_an_interrupt_while_a_picture_tells_its_mode_is_raised(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        for name in "mode", "convert", "has_transparency_data":
            def interrupted(picture):
                raise KeyboardInterrupt

            kind = type("Interrupted", (Pictured,), {name: property(interrupted, lambda picture, value: None)})
            with self.subTest(name=name), self.assertRaises(KeyboardInterrupt):
                tg.Dataset([kind("P", np.full((3, 4), 51, np.uint8))], [camera])

    def test_what_an_array_says_of_itself_is_the_cause(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        for error in TypeError("can't convert cuda:0 device type tensor to numpy"), ValueError("ragged"):
            with self.assertRaisesRegex(TypeError, "^image 0: expected uint8, .* found Raising$") as caught:
                tg.Dataset([Raising(error)], [camera])
            self.assertIs(caught.exception.__cause__, error)

    def test_floats_above_white_are_told(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 4, 3)
        half, wide = np.full((3, 4, 3), 0.5), np.zeros((3, 4, 4))
        wide[0] = 128.0  # of a picture that is transparent for the most part
        self.assertEqual(tg.Dataset([half * 2, half], [camera] * 2).warnings, [])
        told = tg.Dataset([half, wide, half * 255], [camera] * 3).warnings
        self.assertEqual(told, ["2 of 3 images have most of their values above 1, which is white (the first: image 1): "
                                "floats from 0 to 255 want a division by 255"])

    def test_other_threads_and_interrupts_come_between_pictures(self):
        camera = tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 200, 200)
        image = np.full((200, 200, 3), 0.5, np.float32)
        done, counted, seen = threading.Event(), [], []

        def count():
            while not done.is_set():
                counted.append(1)
                time.sleep(0)

        def images():
            for _ in range(200):  # a busy machine may not come to the other thread during one picture
                seen.append(len(counted))
                yield image
                if len(counted) > seen[0]:
                    break

        other = threading.Thread(target=count)
        other.start()
        interval = sys.getswitchinterval()
        try:
            sys.setswitchinterval(100)  # nobody is made to let others go on: whoever lets them does so
            self.assertRaises(tg.Error, tg.Dataset, images(), [camera] * 201)
            self.assertLess(len(seen), 200)
        finally:
            sys.setswitchinterval(interval)
            done.set()
            other.join()
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGALRM, signal.SIG_DFL)
        unread = iter([image] * 1000)
        with self.assertRaises(KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            tg.Dataset(unread, [camera] * 1000)
        self.assertGreater(len(list(unread)), 0)

    def test_a_data_set_is_copied_as_itself(self):
        dataset = tg.Dataset.load(self.scene.name)
        self.assertIs(copy.copy(dataset), dataset)
        self.assertIs(copy.deepcopy([dataset])[0], dataset)

    def test_a_data_set_tells_what_it_was_read_without(self):
        scene = self.folder / "scene"
        shutil.copytree(self.scene.name, scene)
        (scene / "train/r_1.png").unlink()
        self.assertEqual(tg.Dataset.load(self.scene.name).warnings, [])
        self.assertRegex(tg.Dataset.load(self.scene.name, normalize=True).warnings[0], "^normalized: .* times as large")
        self.assertEqual(len(tg.Dataset.load(scene)), 7)
        self.assertRegex(tg.Dataset.load(scene).warnings[0], "^1 of 8 listed images are missing .*train/r_1")

    def test_scores_reports_and_progress_are_copied_and_pickled(self):
        dataset, model = tg.Dataset.load(self.scene.name), tg.Model.load(SAMPLE)
        progress = tg.Trainer(dataset, iterations=3, texture_mode="none").progress
        found = tg.evaluate(model, dataset, flip=True)
        plain = tg.evaluate(model, dataset).mean
        name = os.fsdecode(b"n\xf6me")
        model.save(self.folder / name / "lod-meta.json")
        (self.folder / name / "0/cameras.json").write_text("{")
        warned = tg.convert(self.folder / name / "lod-meta.json", self.folder / "a.ply")
        self.assertIn(name, "".join(warned.warnings))
        measured = tg.convert(SAMPLE, self.folder / "a.sog", target_size=300000, measure=True)
        self.assertGreater(len(found.warnings), 0)

        def values(given):
            names = [each for each, member in vars(type(given)).items() if isinstance(member, property)]
            self.assertGreater(len(names), 3)
            return {each: [values(view) for view in getattr(given, each)] if each == "views" else
                    values(getattr(given, each)) if each == "mean" else getattr(given, each) for each in names}

        for given in progress, found, found.views[1], plain, warned, measured:
            for again in (copy.copy(given), copy.deepcopy(given), *(
                    pickle.loads(pickle.dumps(given, protocol)) for protocol in range(pickle.HIGHEST_PROTOCOL + 1))):
                self.assertIsNot(again, given)
                self.assertEqual((type(again), values(again)), (type(given), values(given)))
            kind = type(given)
            version, *rest = given.__getstate__()
            for state in (), (version + 1, *rest), (version, *rest, 0), (float(version), *rest):
                self.refused("usage", f": expected a state of {1 + len(rest)} values, the first {version}, found ",
                             kind.__new__(kind).__setstate__, state)

    def test_states_of_wrong_types_are_refused(self):
        dataset, model = tg.Dataset.load(self.scene.name), tg.Model.load(SAMPLE)
        evaluation = tg.evaluate(model, dataset)
        for name, given in (("progress", tg.Trainer(dataset).progress), ("evaluation", evaluation),
                            ("score", evaluation.mean), ("camera", dataset.cameras[0]),
                            ("report", tg.convert(SAMPLE, self.folder / "a.ply"))):
            kind, state = type(given), given.__getstate__()
            for i in range(name != "camera", len(state)):
                self.refused("usage",
                             f"{name}: value {i} of the state has a wrong type or is out of range (found dict)",
                             kind.__new__(kind).__setstate__, (*state[:i], {}, *state[i + 1:]))
            with self.subTest(name=name), self.assertRaises(TypeError) as caught:
                kind.__new__(kind).__setstate__("x" * 100000)
            self.assertTrue(str(caught.exception).endswith("\nFound: str"), str(caught.exception)[-200:])
        state = model.__getstate__()
        for i in 5, 8, 9, 10, 11:
            self.refused("usage", f"model: value {i} of the state has a wrong type or is out of range (found dict)",
                         tg.Model.__new__(tg.Model).__setstate__, (*state[:i], {}, *state[i + 1:]))
        for i, found in (2, 1 << 40), (6, -1):
            state = list(tg.Trainer(dataset).progress.__getstate__())
            state[i] = found
            self.refused("usage", f"progress: value {i} of the state has a wrong type or is out of range (found int)",
                         tg.Progress.__new__(tg.Progress).__setstate__, tuple(state))

    def test_numbers_are_written_alike_in_every_locale(self):
        with tempfile.TemporaryDirectory() as folder:
            made = subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", folder + "/de_DE.UTF-8"],
                                  capture_output=True) if shutil.which("localedef") else None
            if made is None or made.returncode != 0:
                self.skipTest("no localedef that makes de_DE.UTF-8")
            text = subprocess.run(
                [sys.executable, "-c", "import locale, sys, textured_gaussians as tg\n"
                 "locale.setlocale(locale.LC_ALL, 'de_DE.UTF-8')\n"
                 "data = tg.Dataset.load(sys.argv[1])\n"
                 "print(f'{0.5:n}', tg.evaluate(tg.Model.load(sys.argv[2]), data))", self.scene.name, SAMPLE],
                env=os.environ | {"PYTHONPATH": FOLDER, "LOCPATH": folder}, capture_output=True, text=True, check=True)
            self.assertRegex(text.stdout, r"^0,5 <Evaluation of 2 photographs: \d+\.\d\d dB, SSIM 0\.\d{4}>$")

    def test_an_interrupt_ends_an_evaluation(self):
        subprocess.run([*MAKE_SAMPLE, self.folder / "scene", "--size", "200", "--views", "2", "--test-views", "24",
                        "--points", "300"], check=True, stdout=subprocess.DEVNULL)
        dataset = tg.Dataset.load(self.folder / "scene")
        model = tg.Model.load(SAMPLE)
        begun = time.monotonic()
        self.assertRegex(repr(tg.evaluate(model, dataset, flip=True)),
                         r"<Evaluation of 24 photographs: \d+\.\d\d dB, SSIM 0\.\d{4}, FLIP 0\.\d{4}>")
        whole = time.monotonic() - begun
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGALRM, signal.SIG_DFL)
        begun = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            signal.setitimer(signal.ITIMER_REAL, whole / 8)
            tg.evaluate(model, dataset, flip=True)
        self.assertLess(time.monotonic() - begun, 0.8 * whole)

    def test_settings_that_there_are_none_of_are_refused(self):
        dataset = tg.Dataset.load(self.scene.name)
        self.refused("usage", "iteration: no such setting", tg.Trainer, dataset, iteration=3)
        self.refused("usage", "iterations", tg.Trainer, dataset, iterations="many")
        self.refused("usage", "threads: is set for all that the library does", tg.Trainer, dataset, threads=2)
        self.refused("usage", "start: expected points, random or a model that is loaded", tg.Trainer, dataset,
                     start=self.folder / "model.tgz")
        told = subprocess.run([*MAKE_SAMPLE[:-1], "--help"], capture_output=True, text=True).stdout
        flags = set(re.findall(r"^ +(?:-\w,\s*)?--([a-z0-9-]+)", told, re.M))
        table = pathlib.Path("library/train.cpp").read_text().split("kOtherFlags[] = {\n")[1].split("};")[0]
        others = re.findall(r'^    \{"([a-z0-9-]+)", ', table, re.M)
        self.assertEqual(len(others), table.count("\n"))
        for other in others:  # a flag, and no setting
            self.assertIn(other, flags)
            self.refused("usage", f"{other}: is ", tg.Trainer, dataset, "default", None, **{"--" + other: "?"})
        flags -= {"preset", "help", "version", "completion", "man"}
        self.assertGreater(len(flags), 60)
        for flag in flags:  # a setting, or told where it is
            with self.subTest(flag=flag):
                try:
                    tg.Trainer(dataset, **{flag: "?"})
                except tg.Error as error:
                    self.assertNotIn("no such setting", str(error))
        name = os.fsdecode(b"n\xf6me")
        self.refused("usage", name, tg.Trainer, dataset, iterations=name)
        self.refused("usage", name, tg.Trainer, dataset, start=name)
        self.refused("usage", name, tg.Trainer, dataset, **{name: 1})
        self.assertEqual(tg.Trainer(dataset, **{"--iterations": 3}).progress.iterations, 3)
        twice = {"sh_degree": 1, "sh-degree": 2}
        self.refused("usage", "sh-degree: is given twice", tg.Trainer, dataset, **twice)
        self.refused("usage", "best", tg.Trainer, dataset, "best")
        self.refused("usage", "quantize-iterations", tg.Trainer, dataset, quantize_iterations=5)
        self.refused("cannot_read", "none", tg.Dataset.load, self.folder / "none")

    def test_a_model_can_be_gone_on_from(self):
        dataset = tg.Dataset.load(self.scene.name)
        start = tg.Trainer(dataset, iterations=2, texture_mode="none").model()
        trainer = tg.Trainer(dataset, start=start, iterations=2, texture_mode="none")
        self.assertTrue((trainer.model().means == start.means).all())
        none = tg.Model(*(np.zeros(shape) for shape in ((0, 3), (0, 4), (0, 3), 0, (0, 1, 3))))
        self.refused("bad_data", "start model: has no Gaussians", tg.Trainer, dataset, start=none)
        idle = tg.Trainer(dataset, iterations=2, texture_mode="none", texture_size=4)
        self.assertEqual(idle.warnings, ["--texture-size: does nothing with --texture-mode none"])
        random = tg.Trainer(dataset, start="random", init_count=77, iterations=1, texture_mode="none")
        self.assertEqual(random.progress.gaussians, 77)
        taken = tg.Trainer(dataset, start=b"random", init_count=77, iterations=b"1", texture_mode=pathlib.Path("none"))
        self.assertEqual((taken.progress.gaussians, taken.progress.iterations), (77, 1))
        self.refused("usage", "start", tg.Trainer, dataset, start="nowhere")


class Conversion(Folder):
    def test_a_conversion_says_what_it_did(self):
        report = tg.convert(SAMPLE, self.folder / "a.glb", measure=True)
        self.assertEqual((report.input_format, report.output_format, report.gaussians), ("tgz", "glb", 5000))
        self.assertEqual(report.output_bytes, (self.folder / "a.glb").stat().st_size)
        self.assertGreater(report.psnr, 40)
        self.refused("cannot_write", "a.glb", tg.convert, SAMPLE, self.folder / "a.glb")
        small = tg.convert(SAMPLE, self.folder / "b.ply", edits=[("decimate", "100"), ("scale", "2")])
        self.assertEqual(small.gaussians, 100)
        self.assertTrue(small.psnr is None)
        self.assertRegex(repr(small), r"<ConvertReport tgz \(\d+ bytes\) to ply \(\d+ bytes\), 100 Gaussians>")
        self.refused("usage", "shrink: no such edit", tg.convert, SAMPLE, self.folder / "c.ply",
                     edits=[("shrink", "2")])
        found = tg.convert(SAMPLE, self.folder / "small.sog", target_size=150000)
        self.assertLessEqual(found.output_bytes, 150000)
        self.assertGreater(found.steps, 1)
        views = [tg.look_at((0, 0, -6), (0, 0, 0), (0, -1, 0), 0.8, 40, 30)]
        for name, flags in {"a.spz": {"spz_version": 3},
                            "b.glb": {"target_psnr": 35, "atlas": "webp", "lean": True, "cameras": False},
                            "c.glb": {"views": views, "texture_step": 0.1, "steps": 2},
                            "d.splat": {"viewer": "three", "viewer_aim": "base", "edits": [("decimate", "9")]}}.items():
            self.assertGreater(tg.convert(SAMPLE, self.folder / name, **flags).output_bytes, 100, name)
        base = [tg.convert(self.folder / "b.glb", self.folder / "base.glb", base_only=True, dry_run=dry).output_bytes
                for dry in (True, False)]
        self.assertEqual(base[0], base[1])
        self.assertEqual(tg.Model.load(self.folder / "base.glb").texture_mode, "none")
        self.assertEqual(len(tg.convert(self.folder / "a.spz", self.folder / "e.ply", spz_axes="rdf").warnings), 0)
        told = []
        tg.convert(SAMPLE, self.folder / "told.sog", edits=[("decimate", "99")], target_psnr=30,
                   progress=lambda *how_far: told.append(how_far))
        self.assertEqual(told, [("target", done, 9) for done in range(10)])
        signal.signal(signal.SIGALRM, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGALRM, signal.SIG_DFL)
        self.addCleanup(signal.setitimer, signal.ITIMER_REAL, 0)
        with self.assertRaises(KeyboardInterrupt):
            tg.convert(SAMPLE, self.folder / "ended.glb", viewer="three",
                       progress=lambda part, done, steps: done or signal.setitimer(signal.ITIMER_REAL, 0.01))
        self.assertFalse((self.folder / "ended.glb").exists())
        self.refused("usage", "--target-size does nothing here", tg.convert, SAMPLE, self.folder / "c.ply",
                     target_size=9)
        self.refused("usage", "--psnr does nothing here", tg.convert, SAMPLE, self.folder / "a.png", measure=True)


class Stubs(unittest.TestCase):
    """What __init__.pyi says is there is there, and the other way round."""

    def test_names_arguments_and_docstrings(self):
        tree = ast.parse((pathlib.Path(FOLDER) / "textured_gaussians/__init__.pyi").read_text())
        stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(stubs), set(tg.__all__))
        lists = [ast.literal_eval(node.value) for node in tree.body if ast.unparse(node).startswith("__all__ = ")]
        self.assertEqual(lists, [tg.__all__])
        for name, node in stubs.items():
            real = getattr(tg, name)
            self.assertTrue(real.__doc__, name)
            if isinstance(node, ast.FunctionDef):
                self.check_arguments(name, node, real)
                continue
            members = {each.name: each for each in node.body if isinstance(each, ast.FunctionDef)}
            for member in members:
                text = inspect.getdoc(getattr(real, member)) or ""
                if not member.startswith("_"):  # beyond what pybind11 says of any
                    self.assertTrue([line for line in text.splitlines() if line and "->" not in line], name + member)
            values = {each.target.id for each in node.body if isinstance(each, ast.AnnAssign)}
            own = {each for each in vars(real) if not each.startswith("_")}
            self.assertEqual({each for each in members if not each.startswith("_")} | values, own, name)
            copying = {"__copy__", "__deepcopy__"}
            self.assertEqual(copying & set(members), copying & set(vars(real)), name)
            # Without a constructor nothing fits the only argument.
            made = members.pop("__init__", None)
            if made and ast.unparse(made.args.args[-1]).endswith(": NoReturn"):
                self.assertRaisesRegex(TypeError, "No constructor defined", real)
            elif made:
                self.check_arguments(f"{name}.__init__", made, real.__init__)
            else:
                self.assertTrue(issubclass(real, Exception), f"{name} is made as any object in __init__.pyi")
            for member, function in members.items():
                if not any(isinstance(d, ast.Name) and d.id == "property" for d in function.decorator_list):
                    self.check_arguments(f"{name}.{member}", function, getattr(real, member))

    def test_generic_types_of_numpy_have_a_parameter(self):
        tree = ast.parse((pathlib.Path(FOLDER) / "textured_gaussians/__init__.pyi").read_text())
        generic = {"np." + name for name in ("number", "integer", "signedinteger", "unsignedinteger", "inexact",
                                             "floating", "complexfloating", "ndarray", "dtype")}
        named = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)]
        with_parameter = [ast.unparse(node.value) for node in ast.walk(tree) if isinstance(node, ast.Subscript)]
        self.assertGreater(sum(each in generic for each in named), 0)
        for each in generic:  # mypy --strict takes no other
            self.assertEqual(named.count(each), with_parameter.count(each), each)

    def check_arguments(self, name, node, real):
        documented = inspect.getdoc(real).splitlines()[0]
        arguments = [each.arg for each in node.args.args + node.args.kwonlyargs if each.arg != "self"]
        for argument in arguments:
            self.assertIn(f"{argument}: ", documented, name)

    def test_an_error_of_a_programs_own_has_a_kind(self):
        self.assertEqual(tg.Error("text").kind, "usage")

    def test_numpy_2_is_refused_by_a_module_that_would_misread_it(self):
        run = subprocess.run(
            [sys.executable, "-c", "import numpy; numpy.__version__ = '2.0.0'; import textured_gaussians"],
            env=os.environ | {"PYTHONPATH": FOLDER}, capture_output=True, text=True)
        if tg._core.pybind11_version < (2, 12):
            self.assertIn("ImportError: textured_gaussians was built with pybind11 before 2.12", run.stderr)
        else:
            self.assertEqual((run.returncode, run.stderr), (0, ""))

    def test_the_package_is_marked_as_typed_and_has_the_projects_version(self):
        self.assertTrue((pathlib.Path(FOLDER) / "textured_gaussians/py.typed").exists())
        self.assertRegex(pathlib.Path("CMakeLists.txt").read_text(), rf"VERSION {tg.__version__}\b")


unittest.main(argv=sys.argv[:1], verbosity=1)

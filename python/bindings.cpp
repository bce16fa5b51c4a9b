// SPDX-License-Identifier: Apache-2.0
// The library's headers as a Python module; arrays are NumPy's.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "core/system/shortened.h"
#include "textured_gaussians/textured_gaussians.h"

namespace py = pybind11;
using namespace py::literals;
using namespace textured_gaussians;

namespace {

// An argument that arrayFrom() takes.
bool isThere(PyObject* object) { return object != nullptr; }
class ArrayLike : public py::object {
  PYBIND11_OBJECT_DEFAULT(ArrayLike, object, isThere)
};

// An argument that pathFrom() takes.
class PathLike : public py::object {
  PYBIND11_OBJECT_DEFAULT(PathLike, object, isThere)
};

// A value that may name a file, as paths do.
bool isValueText(PyObject* object) {
  return isThere(object) &&
         (PyUnicode_Check(object) || PyBytes_Check(object) || PyObject_HasAttrString(object, "__fspath__"));
}
class ValueText : public py::object {
  PYBIND11_OBJECT_DEFAULT(ValueText, object, isValueText)
};

}  // namespace

// In docstrings as in __init__.pyi.
template <>
struct py::detail::handle_type_name<ArrayLike> {
  static constexpr auto name = const_name("numpy.typing.ArrayLike");
};
template <>
struct py::detail::handle_type_name<PathLike> {
  static constexpr auto name = const_name("str | bytes | os.PathLike");
};
template <>
struct py::detail::handle_type_name<ValueText> {
  static constexpr auto name = const_name("str | bytes | os.PathLike");
};

namespace {

// Whether it is an object of the class; isinstance() believes its __class__.
template <typename Value>
bool isOf(py::handle object) {
  return PyObject_TypeCheck(object.ptr(), py::detail::get_type_info(typeid(Value))->type) != 0;
}

// Whether it is an object of the class whose __init__ has not run, or has thrown: of such a one pybind11 makes memory
// that nothing was written to. What shows a frame's variables, as pytest does, comes by them.
template <typename Value>
bool isUnmade(py::handle object) {
  if (!isOf<Value>(object)) return false;
  const auto* type = py::detail::get_type_info(typeid(Value));
  return reinterpret_cast<py::detail::instance*>(object.ptr())->get_value_and_holder(type).value_ptr() == nullptr;
}

template <typename Value>
std::string className() {
  return py::str(py::type::of<Value>().attr("__name__"));
}

template <typename Value, typename... Classes>
concept IsOneOf = (std::is_same_v<Value, Classes> || ...);

}  // namespace

// Of the module's classes. Throws TypeError for an object that was not made.
template <typename Value>
  requires IsOneOf<Value, Camera, Model, Renderer, Dataset, Trainer, TrainProgress, ViewScore, Evaluation,
                   ConvertReport>
class py::detail::type_caster<Value> : public type_caster_base<Value> {
 public:
  bool load(handle given, bool convert) {
    if (!isUnmade<Value>(given)) return type_caster_base<Value>::load(given, convert);
    throw type_error(className<Value>() +
                     ": expected an object that is made (its __init__ has not run, or has failed)");
  }
};

namespace {

// __repr__ by `text` of the value.
template <typename Value, typename Text>
auto shownBy(const Text& text) {
  return [text](const py::object& self) {
    if (!isOf<Value>(self)) {
      throw py::type_error(className<Value>() + ": expected an object of this class, found " +
                           std::string(py::str(py::type::of(self).attr("__name__"))));
    }
    return isUnmade<Value>(self) ? "<" + className<Value>() + " that was not made>" : text(self.cast<const Value&>());
  };
}

template <typename Number>
using ArrayOf = py::array_t<Number, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

// One line, as Error promises, whatever text of the caller's the message holds.
std::string oneLine(std::string message) {
  std::ranges::replace_if(message, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  return message;
}
[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::usage, oneLine(message)); }

// Names of files need not be UTF-8: as os.fsencode and os.fsdecode have them.
std::string fileNameFrom(const py::str& name) {
  const auto bytes = py::reinterpret_steal<py::bytes>(PyUnicode_EncodeFSDefault(name.ptr()));
  if (!bytes) throw py::error_already_set();
  return bytes;
}
std::string fileNameFrom(const ValueText& value) {
  const auto text = py::reinterpret_steal<py::object>(PyOS_FSPath(value.ptr()));
  if (!text) throw py::error_already_set();
  if (py::isinstance<py::bytes>(text)) return py::reinterpret_borrow<py::bytes>(text);
  return fileNameFrom(py::reinterpret_borrow<py::str>(text));
}
// Throws TypeError, which names the argument, also for what a file holds in place of its name.
std::filesystem::path pathFrom(const PathLike& given, const std::string& argument) {
  const bool text = py::isinstance<ValueText>(given);
  const std::string name = text ? fileNameFrom(py::reinterpret_borrow<ValueText>(given)) : "";
  if (text && !(py::isinstance<py::bytes>(given) && name.find('\0') != std::string::npos)) return name;
  throw py::type_error(argument + ": expected a file's name, found " +
                       std::string(py::str(py::type::of(given).attr("__name__"))));
}
py::str fileNameOf(const std::string& name) {
  return py::reinterpret_steal<py::str>(PyUnicode_DecodeFSDefaultAndSize(name.data(), py::ssize_t(name.size())));
}

// In states that are pickled: as they are, whatever their letters.
py::list rawLines(const std::vector<std::string>& lines) {
  py::list texts;
  for (const std::string& line : lines) texts.append(py::bytes(line));
  return texts;
}

// Lines that may name files.
py::list linesOf(const std::vector<std::string>& lines) {
  py::list texts;
  for (const std::string& line : lines) texts.append(fileNameOf(line));
  return texts;
}

// ---- Names of enumerators

template <typename Enum, std::size_t kCount>
struct Names {
  const char* what;
  std::array<const char*, kCount> names;

  Enum parse(const std::string& name) const {
    const auto found = std::ranges::find(names, name);
    if (found != names.end()) return static_cast<Enum>(found - names.begin());
    std::string expected;
    for (const char* each : names) expected += (expected.empty() ? "" : ", ") + std::string(each);
    refuse(std::string(what) + ": expected one of " + expected + ", found \"" + tg::shortened(name) + "\"");
  }
  const char* of(Enum value) const { return names[static_cast<std::size_t>(value)]; }
};
constexpr Names<TextureMode, 4> kModes{"texture mode", {"none", "alpha", "rgb", "rgba"}};
constexpr Names<Intersection, 2> kIntersections{"intersection", {"plane", "max_response"}};
constexpr Names<TextureOutside, 3> kOutsides{"outside", {"base", "clip", "edge"}};
constexpr Names<Output, 8> kOutputs{"output",
                                    {"final", "base", "texture", "alpha", "depth", "normal", "count", "depth_median"}};
constexpr Names<Split, 3> kSplits{"split", {"test", "train", "all"}};
constexpr const char* kKinds[] = {"", "usage", "cannot_read", "bad_data", "cannot_write", "device"};

// ---- Arrays

// The floats of a view, which the model at `owner` keeps alive.
py::array view(std::span<const float> floats, Shape shape, const py::object& owner) {
  py::array array(py::dtype::of<float>(), std::move(shape), floats.data(), owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

// Takes the vector's memory.
template <typename Value>
py::array_t<Value> taken(std::vector<Value>&& values, Shape shape) {
  auto kept = std::make_unique<std::vector<Value>>(std::move(values));
  const Value* data = kept->data();
  const py::capsule owner(kept.release(), [](void* pointer) { delete static_cast<std::vector<Value>*>(pointer); });
  return py::array_t<Value>(std::move(shape), data, owner);
}

// [height, width, channels], or without the last of one channel.
py::array_t<float> arrayOf(Image&& image) {
  Shape shape = {image.height, image.width};
  if (image.channels > 1) shape.push_back(image.channels);
  return taken(std::move(image.data), std::move(shape));
}

std::string shapeText(const py::array& array) {
  std::string text;
  for (py::ssize_t axis = 0; axis < array.ndim(); ++axis) {
    text += (axis > 0 ? ", " : "") + std::to_string(array.shape(axis));
  }
  return "[" + text + "]";
}

std::string wrongType(const std::string& expected, const py::object& found) {
  return oneLine(expected + ", found " + std::string(py::str(found)));
}
[[noreturn]] void refuseType(const std::string& expected, const py::object& found) {
  throw py::type_error(wrongType(expected, found));
}

// What NumPy makes of an argument. Throws TypeError, which begins with `expected` and has as its cause what NumPy or
// the argument's __array__ says, and what else Python raises meanwhile: an __array__ that is interrupted, a warning
// that is an error.
py::array anyArrayFrom(const py::object& given, const std::string& expected) {
  try {
    return py::array(given);
  } catch (py::error_already_set& raised) {
    if (!raised.matches(PyExc_TypeError) && !raised.matches(PyExc_ValueError)) throw;
    py::raise_from(raised, PyExc_TypeError, wrongType(expected, py::type::of(given).attr("__name__")).c_str());
    throw py::error_already_set();
  }
}

// An array of numbers whose type's kind, NumPy's letter, is one of `kinds`. NumPy makes numbers of texts, dates and
// truths, too, and of masked values what lies behind the mask. Throws as anyArrayFrom().
template <typename Number>
ArrayOf<Number> arrayFrom(const py::object& given, std::string_view kinds, const std::string& expected) {
  const py::array array = anyArrayFrom(given, expected);
  if (py::isinstance(array, py::module_::import("numpy.ma").attr("MaskedArray"))) {
    refuseType(expected, py::str("masked values"));
  }
  if (array.size() != 0 && kinds.find(array.dtype().kind()) == kinds.npos) refuseType(expected, array.dtype());
  return ArrayOf<Number>(array);
}

// An array of the shape that `expected` names; a side of -1 is free.
template <typename Array>
void requireShape(const Array& array, const Shape& shape, const std::string& name, const std::string& expected) {
  bool right = array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (std::size_t axis = 0; right && axis < shape.size(); ++axis) {
    right = shape[axis] < 0 || array.shape(static_cast<py::ssize_t>(axis)) == shape[axis];
  }
  if (!right) refuse(name + ": expected an array of shape " + expected + ", found " + shapeText(array));
}

std::vector<float> floatsOf(const py::object& given, const Shape& shape, const std::string& name,
                            const std::string& expected) {
  const auto array = arrayFrom<float>(given, "fiu", name + ": expected numbers");
  requireShape(array, shape, name, expected);
  return {array.data(), array.data() + array.size()};
}

template <std::size_t kCount>
void fill(std::array<double, kCount>& numbers, const py::object& given, const Shape& shape, const std::string& name,
          const std::string& expected) {
  const auto array = arrayFrom<double>(given, "fiu", name + ": expected numbers");
  requireShape(array, shape, name, expected);
  std::copy_n(array.data(), kCount, numbers.begin());
}

// ---- Data sets

template <typename Number>
ByteImage bytesOf(const ArrayOf<Number>& array, int channels) {
  return {static_cast<int>(array.shape(1)),
          static_cast<int>(array.shape(0)),
          channels,
          {array.data(), array.data() + array.size()}};
}

// Of [height, width] or, where it may be `colored`, of [height, width, channels].
template <typename Array>
int channelsOf(const Array& array, const std::string& name, bool colored) {
  constexpr py::ssize_t most = 1 << 30;
  const bool flat = array.ndim() == 2, deep = colored && array.ndim() == 3;
  if ((!flat && !deep) || array.shape(0) > most || array.shape(1) > most || (deep && array.shape(2) > most)) {
    refuse(name + ": expected an array of shape [height, width]" + (colored ? " or [height, width, channels]" : "") +
           ", found " + shapeText(array));
  }
  return deep ? static_cast<int>(array.shape(2)) : 1;
}

// Null where there is none. Throws what else Python raises meanwhile, such as an interrupt.
py::object attributeOf(const py::object& given, const char* name) {
  auto found = py::reinterpret_steal<py::object>(PyObject_GetAttrString(given.ptr(), name));
  if (found) return found;
  if (!PyErr_ExceptionMatches(PyExc_AttributeError)) throw py::error_already_set();
  PyErr_Clear();
  return found;
}

// Of a picture of Pillow's; before 10.1 it does not say so itself.
bool hasTransparency(const py::object& given) {
  const py::object told = attributeOf(given, "has_transparency_data");
  if (told) return py::bool_(told);
  const py::object info = attributeOf(given, "info");
  return py::isinstance<py::dict>(info) && info.contains("transparency");
}

// Of Pillow's pictures some hold bytes that look like others': indices of a palette, inks, another space of colours. Of
// a mode whose arrays have a type of their own that type is judged. Throws TypeError, which names what to convert to
// where Pillow can, and what attributeOf() throws.
void requireMode(const py::object& given, const std::string& name, bool is_mask) {
  const py::object mode = attributeOf(given, "mode");
  if (!py::isinstance<py::str>(mode) || !attributeOf(given, "convert")) return;  // a file that is mapped has one, too
  const std::string found = fileNameFrom(py::str(mode));
  if (found == "1" || found == "F" || found.starts_with("I")) return;
  if (found == "L" || (!is_mask && (found == "RGB" || found == "RGBA"))) return;
  std::string advice;
  if (found != "La" && !(is_mask && found == "LAB")) {
    const bool has_alpha = found.ends_with("A") || found.ends_with("a") || (found == "P" && hasTransparency(given));
    advice = std::string(" (convert(\"") + (is_mask ? "L" : (has_alpha ? "RGBA" : "RGB")) + "\"))";
  }
  throw py::type_error(oneLine(name + ": expected a picture of mode " + (is_mask ? "1 or L" : "L, RGB or RGBA") +
                               ", found " + tg::shortened(found) + advice));
}

bool isOfBytes(const py::array& array) { return py::isinstance<py::array_t<std::uint8_t>>(array); }

ByteImage imageFrom(const py::object& given, const std::string& name) {
  requireMode(given, name, false);
  const std::string expected = name + ": expected uint8, black 0 and white 255, or floats, black 0 and white 1";
  const py::array any = anyArrayFrom(given, expected);
  if (isOfBytes(any)) {
    const auto array = arrayFrom<std::uint8_t>(any, "u", expected);
    return bytesOf(array, channelsOf(array, name, true));
  }
  const auto array = arrayFrom<float>(any, "f", expected);
  const int channels = channelsOf(array, name, true);
  const Image floats{static_cast<int>(array.shape(1)),
                     static_cast<int>(array.shape(0)),
                     channels,
                     {array.data(), array.data() + array.size()}};
  const py::gil_scoped_release release;
  return toBytes(floats, "data set: " + name);
}

ByteImage maskFrom(const py::object& given, const std::string& name) {
  if (given.is_none()) return {};
  requireMode(given, name, true);
  const std::string expected = name + ": expected truths or uint8";
  const py::array any = anyArrayFrom(given, expected);
  const auto array = arrayFrom<std::uint8_t>(any, isOfBytes(any) ? "u" : "b", expected);
  return bytesOf(array, channelsOf(array, name, false));
}

std::vector<float> colorsFrom(const py::object& given) {
  const std::string expected = "colors: expected uint8 up to 255 or floats up to 1";
  const py::array any = anyArrayFrom(given, expected);
  const bool bytes = isOfBytes(any);
  const auto array = arrayFrom<float>(any, bytes ? "u" : "f", expected);
  requireShape(array, {-1, 3}, "colors", "[P, 3]");
  std::vector<float> colors(array.data(), array.data() + array.size());
  if (bytes) std::ranges::transform(colors, colors.begin(), [](float value) { return value / 255; });
  return colors;
}

// What `make` makes of each, by its name. One after the other, so that they need not be in memory together, and no more
// than `most` [cameras], since an iterable may have no end. Throws what a signal's handler raises, such as an
// interrupt.
template <typename Make>
std::vector<ByteImage> picturesOf(const py::iterable& given, std::size_t most, const std::string& what,
                                  const Make& make) {
  std::vector<ByteImage> pictures;
  for (const py::handle each : given) {
    if (pictures.size() == most) refuse(what + "s: more than cameras (expected " + std::to_string(most) + ")");
    pictures.push_back(make(py::reinterpret_borrow<py::object>(each), what + " " + std::to_string(pictures.size())));
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
  return pictures;
}

Dataset makeDataset(const py::iterable& images, std::vector<Camera> cameras,
                    const std::optional<std::vector<ValueText>>& names, const std::optional<ArrayLike>& points,
                    const std::optional<ArrayLike>& colors, const std::optional<py::iterable>& masks,
                    const std::optional<std::array<float, 3>>& background, int test_every) {
  DatasetData data;
  if (names && names->size() != cameras.size()) {
    refuse("names: expected one a camera, " + std::to_string(cameras.size()) + ", found " +
           std::to_string(names->size()));
  }
  for (std::size_t i = 0; names && i < cameras.size(); ++i) cameras[i].name = fileNameFrom((*names)[i]);
  data.images = picturesOf(images, cameras.size(), "image", &imageFrom);
  if (masks) data.masks = picturesOf(*masks, cameras.size(), "mask", &maskFrom);
  data.cameras = std::move(cameras);
  if (points) data.points = floatsOf(*points, {-1, 3}, "points", "[P, 3]");
  if (colors) data.colors = colorsFrom(*colors);
  data.background = background;
  data.test_every = test_every;
  const py::gil_scoped_release release;
  return Dataset(std::move(data));
}

// ---- Models

Model makeModel(const ArrayLike& means, const ArrayLike& rotations, const ArrayLike& log_scales,
                const ArrayLike& opacity_logits, const ArrayLike& sh, const std::string& texture_mode,
                const std::optional<ArrayLike>& texture_rects, const std::optional<ArrayLike>& texels,
                const std::array<float, 3>& background, const std::vector<Camera>& cameras,
                const std::string& intersection, const std::string& outside) {
  ModelData data;
  data.means = floatsOf(means, {-1, 3}, "means", "[N, 3]");
  const auto n = static_cast<py::ssize_t>(data.means.size() / 3);
  data.rotations = floatsOf(rotations, {n, 4}, "rotations", "[N, 4]");
  data.log_scales = floatsOf(log_scales, {n, 3}, "log_scales", "[N, 3]");
  data.opacity_logits = floatsOf(opacity_logits, {n}, "opacity_logits", "[N]");
  const auto coefficients = arrayFrom<float>(sh, "fiu", "sh: expected numbers");
  data.sh = floatsOf(coefficients, {n, -1, 3}, "sh", "[N, K, 3]");
  const py::ssize_t k = coefficients.shape(1);
  while (data.sh_degree < 3 && (data.sh_degree + 1) * (data.sh_degree + 1) < k) ++data.sh_degree;
  if ((data.sh_degree + 1) * (data.sh_degree + 1) != k)
    refuse("sh: expected K of 1, 4, 9 or 16, found " + std::to_string(k));
  data.texture_mode = kModes.parse(texture_mode);
  data.intersection = kIntersections.parse(intersection);
  data.outside = kOutsides.parse(outside);
  data.background = background;
  data.cameras = cameras;
  if (texels) data.texels = floatsOf(*texels, {-1, 4}, "texels", "[T, 4]");
  if (texture_rects) {
    const auto rects = arrayFrom<std::int64_t>(*texture_rects, "iu", "texture_rects: expected integers");
    // None, as a model without textures has them.
    const bool none = rects.ndim() == 2 && rects.shape(0) == 0 && rects.shape(1) == 3;
    if (!none) requireShape(rects, {n, 3}, "texture_rects", "[N, 3]");
    for (py::ssize_t i = 0; i < rects.shape(0); ++i) {
      const std::int64_t offset = rects.at(i, 0), width = rects.at(i, 1), height = rects.at(i, 2);
      if (offset < 0 || offset > 0xffffffff || width < 0 || width > 0xffff || height < 0 || height > 0xffff) {
        refuse("texture_rects: row " + std::to_string(i) +
               ": expected offset, width and height of 32, 16 and 16 bits without a sign");
      }
      data.texture_rects.push_back(
          {static_cast<std::uint32_t>(offset), static_cast<std::uint16_t>(width), static_cast<std::uint16_t>(height)});
    }
  }
  const py::gil_scoped_release release;
  return Model(data);
}

// A value of an object's state. Throws Error(usage), which names the object, for one of another type or out of range.
template <typename Value>
Value valueOf(const py::tuple& state, std::size_t index, const std::string& name) {
  try {
    return state[index].cast<Value>();
  } catch (const py::cast_error&) {
    refuse(name + ": value " + std::to_string(index) + " of the state has a wrong type or is out of range (found " +
           tg::shortened(py::str(py::type::of(state[index]).attr("__name__"))) + ")");
  }
}

py::tuple modelState(const py::object& model) {
  const bool textured = model.cast<const Model&>().textureMode() != TextureMode::none;
  const auto texture = [&](const char* name) { return textured ? py::object(model.attr(name)) : py::none(); };
  return py::make_tuple(model.attr("means"), model.attr("rotations"), model.attr("log_scales"),
                        model.attr("opacity_logits"), model.attr("sh"), model.attr("texture_mode"),
                        texture("texture_rects"), texture("texels"), model.attr("background"), model.attr("cameras"),
                        model.attr("intersection"), model.attr("outside"));
}

Model modelFrom(const py::tuple& state) {
  if (state.size() != 12) refuse("model: expected a state of 12 values, found " + std::to_string(state.size()));
  const auto array = [&](std::size_t i) { return py::reinterpret_borrow<ArrayLike>(state[i]); };
  const auto texture = [&](std::size_t i) { return state[i].is_none() ? std::nullopt : std::optional(array(i)); };
  return makeModel(array(0), array(1), array(2), array(3), array(4), valueOf<std::string>(state, 5, "model"),
                   texture(6), texture(7), valueOf<std::array<float, 3>>(state, 8, "model"),
                   valueOf<std::vector<Camera>>(state, 9, "model"), valueOf<std::string>(state, 10, "model"),
                   valueOf<std::string>(state, 11, "model"));
}

py::ssize_t gaussians(const Model& model) { return static_cast<py::ssize_t>(model.size()); }

// A view of a model's numbers, one row a Gaussian.
template <std::span<const float> (Model::*kNumbers)() const>
py::array numbers(const py::object& self, Shape row) {
  const Model& model = self.cast<const Model&>();
  row.insert(row.begin(), gaussians(model));
  return view((model.*kNumbers)(), std::move(row), self);
}

// The exception that carries an Error's kind.
void bindError(py::module_& module) {
  // Kept for as long as the process lives: it may be thrown until then.
  static const py::handle error = py::exception<Error>(module, "Error", PyExc_RuntimeError).release();
  error.attr("__doc__") =
      "What the library refuses, with one line for users.\n\nkind: \"usage\", \"cannot_read\", \"bad_data\", "
      "\"cannot_write\" or \"device\".";
  error.attr("kind") = kKinds[static_cast<int>(ErrorKind::usage)];  // of one that Python makes
  py::register_local_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const std::bad_alloc&) {
      PyErr_SetString(PyExc_MemoryError, "the memory that the system grants this process is not enough");
    }
  });
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const Error& refused) {
      const py::object raised = error(fileNameOf(refused.what()));
      raised.attr("kind") = kKinds[static_cast<int>(refused.kind())];
      PyErr_SetObject(error.ptr(), raised.ptr());
    }
  });
}

// A copy that says so where somebody writes to it.
template <std::size_t kCount>
py::array fixed(const std::array<double, kCount>& numbers, Shape shape) {
  py::array array = taken(std::vector<double>(numbers.begin(), numbers.end()), std::move(shape));
  array.attr("flags").attr("writeable") = false;
  return array;
}

// Of states that begin with their version. Throws Error(usage) for another version or number of values.
void requireState(const py::tuple& state, int version, std::size_t values, const std::string& name) {
  if (state.size() == values && py::isinstance<py::int_>(state[0]) && py::object(state[0]).equal(py::int_(version)))
    return;
  const std::string first = state.empty() ? "" : ", the first " + tg::shortened(py::str(py::repr(state[0])));
  refuse(name + ": expected a state of " + std::to_string(values) + " values, the first " + std::to_string(version) +
         ", found " + std::to_string(state.size()) + first);
}

py::tuple stateOf(const Camera& camera) {
  return py::make_tuple(py::tuple(py::cast(camera.rotation)), py::tuple(py::cast(camera.translation)),
                        py::tuple(py::cast(camera.focal)), py::tuple(py::cast(camera.center)), camera.width,
                        camera.height, py::bytes(camera.name), camera.test);
}

Camera cameraFrom(const py::tuple& state) {
  Camera camera;
  if (state.size() != 8) refuse("camera: expected a state of 8 values, found " + std::to_string(state.size()));
  camera.rotation = valueOf<decltype(camera.rotation)>(state, 0, "camera");
  camera.translation = valueOf<decltype(camera.translation)>(state, 1, "camera");
  camera.focal = valueOf<decltype(camera.focal)>(state, 2, "camera");
  camera.center = valueOf<decltype(camera.center)>(state, 3, "camera");
  camera.width = valueOf<int>(state, 4, "camera");
  camera.height = valueOf<int>(state, 5, "camera");
  camera.name = valueOf<std::string>(state, 6, "camera");
  camera.test = valueOf<bool>(state, 7, "camera");
  return camera;
}

bool sameCamera(const Camera& a, const Camera& b) { return stateOf(a).equal(stateOf(b)); }

void bindCamera(py::module_& module) {
  py::class_<Camera>(module, "Camera", R"(A pinhole camera.

Axes: x right, y down, z forward; pixel centres lie at +0.5, the image's left edge at x = 0. A point p of the world
appears at (x / z, y / z) * focal + center [px], with (x, y, z) = rotation @ p + translation.)")
      .def(py::init([](const ArrayLike& rotation, const ArrayLike& translation, const ArrayLike& focal,
                       const ArrayLike& center, int width, int height, const ValueText& name, bool test) {
             Camera camera;
             fill(camera.rotation, rotation, {3, 3}, "rotation", "[3, 3]");
             fill(camera.translation, translation, {3}, "translation", "[3]");
             fill(camera.focal, focal, {2}, "focal", "[2]");
             fill(camera.center, center, {2}, "center", "[2]");
             camera.width = width;
             camera.height = height;
             camera.name = fileNameFrom(name);
             camera.test = test;
             return camera;
           }),
           "rotation"_a, "translation"_a, "focal"_a, "center"_a, "width"_a, "height"_a, "name"_a = "", "test"_a = false,
           R"(rotation [3, 3], orthonormal, and translation [3] [world units]: camera from world; focal [2] and center
[2] [px]; width and height [px]. What makes no camera is refused where it is used.)")
      .def_property_readonly(
          "rotation", [](const Camera& camera) { return fixed(camera.rotation, {3, 3}); },
          "float64 [3, 3]: camera from world. A copy, as the other arrays.")
      .def_property_readonly(
          "translation", [](const Camera& camera) { return fixed(camera.translation, {3}); },
          "float64 [3]: camera from world [world units].")
      .def_property_readonly(
          "focal", [](const Camera& camera) { return fixed(camera.focal, {2}); }, "float64 [2]: x, y [px].")
      .def_property_readonly(
          "center", [](const Camera& camera) { return fixed(camera.center, {2}); }, "float64 [2]: x, y [px].")
      .def_readonly("width", &Camera::width, "[px]")
      .def_readonly("height", &Camera::height, "[px]")
      .def_property_readonly(
          "name", [](const Camera& camera) { return fileNameOf(camera.name); },
          "Of the photograph, without its folder; may be empty.")
      .def_readonly("test", &Camera::test, "Whether it was held out from training.")
      .def("__eq__", &sameCamera, py::is_operator())
      .def("__hash__", [](const Camera& camera) { return py::hash(stateOf(camera)); })
      .def(py::pickle(&stateOf, &cameraFrom))
      .def("__repr__", shownBy<Camera>([](const Camera& camera) {
             return "<Camera " + std::string(py::repr(fileNameOf(camera.name))) + " " + std::to_string(camera.width) +
                    " x " + std::to_string(camera.height) + (camera.test ? ", held out" : "") + ">";
           }));
  module.def("look_at", &lookAt, "eye"_a, "target"_a, "up"_a, "fov_y"_a, "width"_a, "height"_a,
             R"(A camera at `eye` that looks at `target`, both [3] in world space; `up` [3] points to the picture's top.
fov_y: the vertical field of view [radians].)");
}

void bindModel(py::module_& module) {
  py::class_<Model>(module, "Model",
                    R"(Gaussians with textures. A model does not change: its arrays are read-only views.

World space is the data set's, right-handed; nothing is rescaled.)")
      .def(py::init(&makeModel), "means"_a, "rotations"_a, "log_scales"_a, "opacity_logits"_a, "sh"_a, py::kw_only(),
           "texture_mode"_a = "none", "texture_rects"_a = py::none(), "texels"_a = py::none(),
           "background"_a = std::array<float, 3>{}, "cameras"_a = std::vector<Camera>{},
           "intersection"_a = "max_response", "outside"_a = "base", R"(A model of N Gaussians from arrays of float32.

means [N, 3] [world units]; rotations [N, 4] quaternions w, x, y, z, world from Gaussian, of a length from 1e-22 to
1e19; log_scales [N, 3] ln(sigma); opacity_logits [N], opacity = 1 / (1 + exp(-logit)); sh [N, K, 3] with K = 1, 4, 9 or
16, colour = 0.5 + sum of sh times basis; texture_mode "alpha", "rgb" or "rgba", or "none", which has no texture_rects
and no texels; texture_rects [N, 3] integers offset, width, height [texels]: texel (i, j), i along u, is
texels[offset + j * width + i]; texels [T, 4] RGB, added to the base colour, and a factor on alpha in [0, 1]; background
RGB that it was trained against; cameras of the photographs that it was trained on; intersection, where a ray meets a
Gaussian: "plane" or "max_response"; outside, what is drawn of a textured Gaussian beyond +-3 sigma: "base", "clip" or
"edge".)")
      .def_static(
          "load",
          [](const PathLike& given) {
            const std::filesystem::path path = pathFrom(given, "path");
            const py::gil_scoped_release release;
            return Model::load(path);
          },
          "path"_a, "From any file that tgconvert reads (docs/formats.md), such as a .tgz, .glb, .ply or .spz.")
      .def(
          "save",
          [](const Model& model, const PathLike& given) {
            const std::filesystem::path path = pathFrom(given, "path");
            return linesOf([&] {
              const py::gil_scoped_release release;
              return model.save(path);
            }());
          },
          "path"_a, R"(In the format of the extension. A file that is there is replaced once the new one is complete.

Returns what the format does not hold, a line each.)")
      .def("__copy__", [](const py::object& self) { return self; })
      .def(
          "__deepcopy__", [](const py::object& self, const py::object&) { return self; }, "memo"_a)
      .def(py::pickle(&modelState, &modelFrom))
      .def("__len__", &Model::size)
      .def("__repr__", shownBy<Model>([](const Model& model) {
             return "<Model of " + std::to_string(model.size()) + " Gaussians, SH degree " +
                    std::to_string(model.shDegree()) + ", textures " + kModes.of(model.textureMode()) + ">";
           }))
      .def_property_readonly(
          "means", [](const py::object& self) { return numbers<&Model::means>(self, {3}); },
          "float32 [N, 3] [world units].")
      .def_property_readonly(
          "rotations", [](const py::object& self) { return numbers<&Model::rotations>(self, {4}); },
          "float32 [N, 4]: quaternions w, x, y, z, world from Gaussian.")
      .def_property_readonly(
          "log_scales", [](const py::object& self) { return numbers<&Model::logScales>(self, {3}); },
          "float32 [N, 3]: ln(sigma), sigma in [world units].")
      .def_property_readonly(
          "opacity_logits", [](const py::object& self) { return numbers<&Model::opacityLogits>(self, {}); },
          "float32 [N]: opacity = 1 / (1 + exp(-logit)).")
      .def_property_readonly(
          "sh",
          [](const py::object& self) {
            const py::ssize_t side = self.cast<const Model&>().shDegree() + 1;
            return numbers<&Model::sh>(self, {side * side, 3});
          },
          "float32 [N, K, 3], K = (sh_degree + 1) ** 2.")
      .def_property_readonly(
          "texels",
          [](const py::object& self) {
            const std::span<const float> texels = self.cast<const Model&>().texels();
            return view(texels, {static_cast<py::ssize_t>(texels.size() / 4), 4}, self);
          },
          "float32 [T, 4]: RGB, added to the base colour, and a factor on alpha.")
      .def_property_readonly(
          "texture_rects",
          [](const Model& model) {
            const std::vector<TextureRect> rects = model.textureRects();
            std::vector<std::int64_t> rows;
            for (const TextureRect& rect : rects) rows.insert(rows.end(), {rect.offset, rect.width, rect.height});
            return taken(std::move(rows), {static_cast<py::ssize_t>(rects.size()), 3});
          },
          "int64 [N, 3]: offset, width, height [texels]; [0, 3] without textures. A copy.")
      .def_property_readonly("sh_degree", &Model::shDegree, "0 to 3.")
      .def_property_readonly(
          "texture_mode", [](const Model& model) { return kModes.of(model.textureMode()); },
          "\"none\", \"alpha\", \"rgb\" or \"rgba\".")
      .def_property_readonly(
          "intersection", [](const Model& model) { return kIntersections.of(model.intersection()); },
          "Where a ray meets a Gaussian: \"plane\" or \"max_response\".")
      .def_property_readonly(
          "outside", [](const Model& model) { return kOutsides.of(model.outside()); },
          "What is drawn of a textured Gaussian beyond +-3 sigma: \"base\", \"clip\" or \"edge\".")
      .def_property_readonly(
          "background", [](const Model& model) { return py::tuple(py::cast(model.background())); },
          "RGB that it was trained against.")
      .def_property_readonly("cameras", &Model::cameras, "Of the photographs that it was trained on; may be empty.")
      .def_property_readonly(
          "warnings", [](const Model& model) { return linesOf(model.warnings()); },
          "What reading repaired or passed over, a line each.");
}

void bindRendering(py::module_& module) {
  py::class_<Renderer>(
      module, "Renderer",
      "Draws a model on the processor, with all threads. Calls of several threads wait for one another.")
      .def(py::init<const Model&>(), "model"_a)
      .def(
          "render",
          [](Renderer& renderer, const Camera& camera, const std::string& output, const std::string& textures,
             const std::optional<std::array<float, 3>>& background, float splat_scale, float opacity_scale,
             int max_sh_degree) {
            const RenderOptions options{kModes.parse(textures), background, splat_scale, opacity_scale, max_sh_degree};
            const Output wanted = kOutputs.parse(output);
            return arrayOf([&] {
              const py::gil_scoped_release release;
              return renderer.render(camera, wanted, options);
            }());
          },
          "camera"_a, "output"_a = "final", py::kw_only(), "textures"_a = "rgba", "background"_a = py::none(),
          "splat_scale"_a = 1.0f, "opacity_scale"_a = 1.0f, "max_sh_degree"_a = 3, R"(A picture as float32, not clamped.

output: "final", "base" (without what textures add), "texture" (what they add), "normal": [height, width, 3]; "alpha",
"depth" and "depth_median" (camera z [world units], 0 where nothing is hit), "count" (of blended Gaussians): [height,
width]. textures: terms that count. background: RGB; None: the model's. splat_scale: above 0, on every sigma.
opacity_scale: 0 or above, on every opacity. max_sh_degree: 0 to 3, higher bands are left out.)");
  module.def(
      "set_threads", &setThreads, "count"_a,
      "Threads from now on, also of what another thread of Python runs meanwhile; 0, as at the start: as many as the "
      "machine has. Results do not depend on it.");
  module.def(
      "read_image",
      [](const PathLike& given) {
        const std::filesystem::path path = pathFrom(given, "path");
        return arrayOf([&] {
          const py::gil_scoped_release release;
          return readImage(path);
        }());
      },
      "path"_a,
      "PNG, JPEG, WebP or EXR as float32 [height, width, 3 or 4], grey as [height, width]; black 0, white 1.");
  module.def(
      "write_image",
      [](const PathLike& named, const ArrayLike& given) {
        const std::filesystem::path path = pathFrom(named, "path");
        const auto image = arrayFrom<float>(
            given, "f", "image: expected floats, black 0 and white 1");  // 8 bits would be clamped to white
        if (image.ndim() != 2 && image.ndim() != 3) {
          refuse("image: expected an array of shape [height, width] or [height, width, channels], found " +
                 shapeText(image));
        }
        const auto side = [&](py::ssize_t axis) {
          return static_cast<int>(std::min<py::ssize_t>(image.shape(axis), 1 << 30));
        };
        const int channels = image.ndim() == 3 ? side(2) : 1;
        const Image made{side(1), side(0), channels, {image.data(), image.data() + image.size()}};
        const py::gil_scoped_release release;
        writeImage(path, made);
      },
      "path"_a, "image"_a,
      R"(By the extension: .png and .jpg (clamped to [0, 1], 8 bits; finite numbers alone) or .exr (half floats).)");
}

// As in any locale.
std::string decimals(double number, int digits) {
  std::array<char, 400> text;  // the largest double has 309 digits before its point
  const auto end = std::to_chars(text.data(), text.data() + text.size(), number, std::chars_format::fixed, digits).ptr;
  return {text.data(), end};
}

// What an array of one holds, as of a number of NumPy's; anything else as it is.
py::object itemOf(const py::object& value) {
  if (!py::hasattr(value, "dtype") || !py::hasattr(value, "item")) return value;
  try {
    return value.attr("item")();
  } catch (const py::error_already_set& raised) {  // as an array of several does
    if (!raised.matches(PyExc_ValueError) && !raised.matches(PyExc_RuntimeError)) throw;
    return value;
  }
}

// As tgtrain's flags take it. Throws TypeError, which names the setting, for what is no text, number or truth.
std::string settingText(const std::string& setting, const py::object& given) {
  const py::object value = itemOf(given);
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "on" : "off";
  if (py::isinstance<ValueText>(value)) return fileNameFrom(py::reinterpret_borrow<ValueText>(value));
  if (!py::isinstance(value, py::module_::import("numbers").attr("Number"))) {
    refuseType(tg::shortened(setting) + ": expected a text, a number or a truth", py::type::of(value).attr("__name__"));
  }
  return fileNameFrom(py::str(value));
}

constexpr int kProgressState = 1;  // version

py::tuple progressState(const TrainProgress& progress) {
  return py::make_tuple(kProgressState, progress.stage, progress.iteration, progress.iterations, progress.loss,
                        progress.psnr, progress.gaussians, progress.seconds_left);
}

TrainProgress progressFrom(const py::tuple& state) {
  requireState(state, kProgressState, 8, "progress");
  return {valueOf<std::string>(state, 1, "progress"), valueOf<int>(state, 2, "progress"),
          valueOf<int>(state, 3, "progress"),         valueOf<double>(state, 4, "progress"),
          valueOf<double>(state, 5, "progress"),      valueOf<std::size_t>(state, 6, "progress"),
          valueOf<double>(state, 7, "progress")};
}

void bindTraining(py::module_& module) {
  py::class_<Dataset>(module, "Dataset", "Photographs with known cameras. A data set does not change.")
      .def(py::init(&makeDataset), "images"_a, "cameras"_a, py::kw_only(), "names"_a = py::none(),
           "points"_a = py::none(), "colors"_a = py::none(), "masks"_a = py::none(), "background"_a = py::none(),
           "test_every"_a = 8, R"(N photographs in memory; they train and score as PNGs of them in a folder.

Their order becomes that of a folder: by name, those to train on first. photograph(i), cameras[i] and an evaluation's
views[i] are therefore not of images[i]; where no camera has a name, both parts keep the order in which they are given.

images: N arrays [height, width, 3 or 4] or [height, width], of uint8, or of floats with black 0 and white 1, which are
clamped and rounded to 8 bits, of Pillow's pictures those of mode L, RGB or RGBA; any iterable, of which one after the
other is read. cameras: N, each of its image's size; where one is .test these are held out. names: N, of the
photographs, instead of the cameras' own: str, bytes or os.PathLike. points [P, 3] [world units]; None: training starts
from random ones. colors [P, 3] of the points: uint8, or floats from 0 to 1; None: grey. masks: N arrays [height, width]
of truths or uint8, of Pillow's of mode 1 or L, or None for one: pixels where it is 0 are neither trained on nor scored.
background: RGB behind images of 4 channels; None: black, and an evaluation goes over the model's. test_every: every
n-th photograph by name is held out where no camera is; 0: none.)")
      .def_static(
          "load",
          [](const PathLike& given, int downscale, const std::optional<std::array<float, 3>>& background,
             int test_every, bool normalize) {
            const std::filesystem::path folder = pathFrom(given, "folder");
            const py::gil_scoped_release release;
            return Dataset::load(folder, {downscale, background, test_every, normalize});
          },
          "folder"_a, py::kw_only(), "downscale"_a = 1, "background"_a = py::none(), "test_every"_a = 8,
          "normalize"_a = false,
          R"(A NeRF-synthetic, instant-ngp / nerfstudio or COLMAP folder.

downscale: whole number. background: RGB behind transparent photographs; None: the data set's own, else white for
NeRF-synthetic, else black; an evaluation goes over the model's then. test_every: every n-th photograph is held out
where the data set has no split; 0: none. normalize: cameras and points are moved and scaled, of scenes that are small
or far from the origin; a line of warnings says how a model is brought back.)")
      .def("__copy__", [](const py::object& self) { return self; })
      .def(
          "__deepcopy__", [](const py::object& self, const py::object&) { return self; }, "memo"_a)
      .def("__len__", &Dataset::size)
      .def_property_readonly("cameras", &Dataset::cameras, "[len()], those to train on first; .test: held out.")
      .def("__repr__", shownBy<Dataset>([](const Dataset& dataset) {
             return "<Dataset of " + std::to_string(dataset.size()) + " photographs>";
           }))
      .def_property_readonly(
          "background", [](const Dataset& dataset) { return py::tuple(py::cast(dataset.background())); }, "RGB.")
      .def_property_readonly(
          "warnings", [](const Dataset& dataset) { return linesOf(dataset.warnings()); },
          "What reading passed over or took otherwise than it was listed, as missing photographs, and arrays of floats "
          "that are mostly above white, 1: a line each.")
      .def(
          "photograph",
          [](const Dataset& dataset, py::ssize_t index) {
            if (index < 0) {
              refuse("photograph: no such one (expected 0 to " + std::to_string(dataset.size() - 1) + ", found " +
                     std::to_string(index) + ")");
            }
            return arrayOf([&] {
              const py::gil_scoped_release release;
              return dataset.photograph(static_cast<std::size_t>(index));
            }());
          },
          "index"_a, "float32 [height, width, 3] over the background.");

  py::class_<TrainProgress>(module, "Progress", "Where a training stands.")
      .def_readonly("stage", &TrainProgress::stage,
                    "\"plain\" (no textures yet), \"textured\", \"untextured\", \"count\".")
      .def_readonly("iteration", &TrainProgress::iteration, "Done in this stage.")
      .def_readonly("iterations", &TrainProgress::iterations, "Of this stage.")
      .def_readonly("loss", &TrainProgress::loss, "Running mean over training photographs; 0 before the first.")
      .def_readonly("psnr", &TrainProgress::psnr, "Running mean over training photographs [dB]; 0 before the first.")
      .def_readonly("gaussians", &TrainProgress::gaussians, "Of the model as it stands.")
      .def("__repr__", shownBy<TrainProgress>([](const TrainProgress& progress) {
             return "<Progress " + progress.stage + " " + std::to_string(progress.iteration) + " of " +
                    std::to_string(progress.iterations) + ", " + std::to_string(progress.gaussians) + " Gaussians, " +
                    decimals(progress.psnr, 2) + " dB>";
           }))
      .def(py::pickle(&progressState, &progressFrom))
      .def_readonly("seconds_left", &TrainProgress::seconds_left, "Of all stages, as far as it can be told.");

  py::class_<Trainer>(module, "Trainer",
                      "A training on the processor, with all threads. Calls of several threads wait for one another.")
      .def(py::init([](const Dataset& dataset, const std::string& preset,
                       const std::optional<std::variant<ValueText, Model>>& start, const py::kwargs& settings) {
             TrainOptions options{preset, {}};
             std::optional<Model> model;
             if (start && std::holds_alternative<Model>(*start)) {
               model = std::get<Model>(*start);
             } else if (start) {
               options.settings["start"] = fileNameFrom(std::get<ValueText>(*start));
             }
             for (const auto& [key, value] : settings) {
               std::string name = fileNameFrom(py::str(key));
               std::ranges::replace(name, '_', '-');
               const py::object given = py::reinterpret_borrow<py::object>(value);
               if (!options.settings.emplace(name, settingText(name, given)).second) {
                 refuse(tg::shortened(name) + ": is given twice");
               }
             }
             const py::gil_scoped_release release;
             return std::make_unique<Trainer>(dataset, options, model);
           }),
           "dataset"_a, "preset"_a = "default", "start"_a = py::none(), R"(preset, and over it settings by the names of
tgtrain's flags, with _ for -: Trainer(dataset, iterations=7000, texture_size=4). start: a model to go on from, as
Model.load() or another training gives it, or tgtrain's setting of this name, "points" or "random". Texts may be str,
bytes and os.PathLike, as paths are.)")
      .def("step", &Trainer::step, py::call_guard<py::gil_scoped_release>(),
           "One iteration; False: there was none left.")
      .def_property_readonly("progress", py::cpp_function(&Trainer::progress, py::call_guard<py::gil_scoped_release>()),
                             "A Progress: stage, iteration, loss and others, as of now.")
      .def_property_readonly(
          "warnings", [](const Trainer& trainer) { return linesOf(trainer.warnings()); },
          "Lines about settings that do nothing here, and about a start model that filter_3d filters once more.")
      .def("model", &Trainer::model, py::call_guard<py::gil_scoped_release>(),
           "As it stands, with the data set's cameras and background: a copy.");
}

std::string figures(const ViewScore& score) {
  return decimals(score.psnr, 2) + " dB, SSIM " + decimals(score.ssim, 4) +
         (score.flip ? ", FLIP " + decimals(*score.flip, 4) : "");
}

constexpr int kScoreState = 1, kEvaluationState = 1, kReportState = 1;  // versions

py::tuple scoreState(const ViewScore& score) {
  return py::make_tuple(kScoreState, py::bytes(score.name), score.psnr, score.ssim, score.flip);
}

ViewScore scoreFrom(const py::tuple& state) {
  requireState(state, kScoreState, 5, "score");
  return {valueOf<std::string>(state, 1, "score"), valueOf<double>(state, 2, "score"),
          valueOf<double>(state, 3, "score"), valueOf<std::optional<double>>(state, 4, "score")};
}

py::tuple evaluationState(const Evaluation& evaluation) {
  return py::make_tuple(kEvaluationState, evaluation.views, evaluation.mean, py::tuple(py::cast(evaluation.background)),
                        rawLines(evaluation.warnings));
}

Evaluation evaluationFrom(const py::tuple& state) {
  requireState(state, kEvaluationState, 5, "evaluation");
  return {valueOf<std::vector<ViewScore>>(state, 1, "evaluation"), valueOf<ViewScore>(state, 2, "evaluation"),
          valueOf<std::array<float, 3>>(state, 3, "evaluation"),
          valueOf<std::vector<std::string>>(state, 4, "evaluation")};
}

py::tuple reportState(const ConvertReport& report) {
  return py::make_tuple(kReportState, report.input_format, report.output_format, report.input_bytes,
                        report.output_bytes, report.gaussians, report.steps, report.psnr, rawLines(report.warnings));
}

ConvertReport reportFrom(const py::tuple& state) {
  requireState(state, kReportState, 9, "report");
  return {valueOf<std::string>(state, 1, "report"),           valueOf<std::string>(state, 2, "report"),
          valueOf<std::uint64_t>(state, 3, "report"),         valueOf<std::uint64_t>(state, 4, "report"),
          valueOf<std::size_t>(state, 5, "report"),           valueOf<std::optional<float>>(state, 6, "report"),
          valueOf<std::optional<double>>(state, 7, "report"), valueOf<std::vector<std::string>>(state, 8, "report")};
}

void bindEvaluation(py::module_& module) {
  py::class_<ViewScore>(module, "ViewScore", "How close a picture comes to a photograph.")
      .def_property_readonly(
          "name", [](const ViewScore& score) { return fileNameOf(score.name); }, "Of the photograph.")
      .def_readonly("psnr", &ViewScore::psnr, "[dB] after rounding to 8 bits; inf when equal.")
      .def_readonly("ssim", &ViewScore::ssim, "Up to 1.")
      .def_readonly("flip", &ViewScore::flip, "0 (equal) to 1; None where it was not asked for.")
      .def(py::pickle(&scoreState, &scoreFrom))
      .def("__repr__", shownBy<ViewScore>([](const ViewScore& score) {
             return "<ViewScore " + (score.name.empty() ? "" : std::string(py::repr(fileNameOf(score.name))) + " ") +
                    figures(score) + ">";
           }));
  py::class_<Evaluation>(module, "Evaluation", "How close pictures of a model come to the photographs of a data set.")
      .def_readonly("views", &Evaluation::views, "A ViewScore a photograph.")
      .def_readonly("mean", &Evaluation::mean, "Of every figure; its name is empty.")
      .def_property_readonly(
          "background", [](const Evaluation& evaluation) { return py::tuple(py::cast(evaluation.background)); },
          "RGB behind photographs and pictures.")
      .def_property_readonly(
          "warnings", [](const Evaluation& evaluation) { return linesOf(evaluation.warnings); },
          "Of a model that was trained on others than these photographs, a line each.")
      .def(py::pickle(&evaluationState, &evaluationFrom))
      .def("__repr__", shownBy<Evaluation>([](const Evaluation& evaluation) {
             return "<Evaluation of " + std::to_string(evaluation.views.size()) +
                    " photographs: " + figures(evaluation.mean) + ">";
           }));
  module.def(
      "evaluate",
      [](const Model& model, const Dataset& dataset, const std::string& split, bool flip, const std::string& textures,
         const std::optional<py::function>& progress) {
        const auto tell = [&](std::size_t done, std::size_t photographs) {
          const py::gil_scoped_acquire acquire;
          if (PyErr_CheckSignals() != 0) throw py::error_already_set();
          if (progress) (*progress)(done, photographs);
        };
        const EvaluateOptions options{kSplits.parse(split), flip, kModes.parse(textures), tell};
        const py::gil_scoped_release release;
        return evaluate(model, dataset, options);
      },
      "model"_a, "dataset"_a, py::kw_only(), "split"_a = "test", "flip"_a = false, "textures"_a = "rgba",
      "progress"_a = py::none(),
      R"(PSNR, SSIM and, where asked for, FLIP of the photographs of a split: "test", "train" or "all".

progress: called as progress(done, photographs) after every one, on this thread; what it raises ends the evaluation.

As tgeval does it, the same numbers: over the background that the data set was made or loaded with, where one was asked
for, else the model's, where it is known, as of a .tgz and of what has cameras, else the data set's.)");

  py::class_<ConvertReport>(module, "ConvertReport", "What a conversion read and wrote.")
      .def(py::pickle(&reportState, &reportFrom))
      .def("__repr__", shownBy<ConvertReport>([](const ConvertReport& report) {
             return "<ConvertReport " + report.input_format + " (" + std::to_string(report.input_bytes) +
                    " bytes) to " + report.output_format + " (" + std::to_string(report.output_bytes) + " bytes), " +
                    std::to_string(report.gaussians) + " Gaussians>";
           }))
      .def_readonly("input_format", &ConvertReport::input_format, "By its name in docs/formats.md, as \"tgz\".")
      .def_readonly("output_format", &ConvertReport::output_format, "Likewise.")
      .def_readonly("input_bytes", &ConvertReport::input_bytes, "In all files of the model.")
      .def_readonly("output_bytes", &ConvertReport::output_bytes, "Likewise.")
      .def_readonly("gaussians", &ConvertReport::gaussians, "Written.")
      .def_readonly("steps", &ConvertReport::steps, "That were asked for, or found for a target; None without both.")
      .def_readonly("psnr", &ConvertReport::psnr, "[dB] of the file read back; None where it was not measured.")
      .def_property_readonly(
          "warnings", [](const ConvertReport& report) { return linesOf(report.warnings); },
          "What the format does not hold, a line each.");
  module.def(
      "convert",
      [](const PathLike& input, const PathLike& output, bool overwrite, bool quantize, bool meshopt, bool measure,
         std::optional<float> steps, const std::vector<std::pair<std::string, py::object>>& edits,
         std::optional<std::uint64_t> target_size, std::optional<double> target_psnr, std::optional<float> texture_step,
         bool cameras, const std::vector<Camera>& views, bool base_only, bool lean,
         const std::optional<std::string>& atlas, std::optional<int> spz_version,
         const std::optional<std::string>& spz_axes, const std::optional<std::string>& viewer,
         const std::optional<std::string>& viewer_aim, bool dry_run, const std::optional<py::function>& progress) {
        const auto tell = [&](const std::string& part, std::size_t done, std::size_t all) {
          const py::gil_scoped_acquire acquire;
          if (PyErr_CheckSignals() != 0) throw py::error_already_set();
          if (progress) (*progress)(part, done, all);
        };
        ConvertOptions options{.overwrite = overwrite,
                               .quantize = quantize,
                               .meshopt = meshopt,
                               .measure = measure,
                               .steps = steps,
                               .edits = {},
                               .target_size = target_size,
                               .target_psnr = target_psnr,
                               .texture_step = texture_step,
                               .cameras = cameras,
                               .views = views,
                               .base_only = base_only,
                               .lean = lean,
                               .atlas = atlas,
                               .spz_version = spz_version,
                               .spz_axes = spz_axes,
                               .viewer = viewer,
                               .viewer_aim = viewer_aim,
                               .dry_run = dry_run,
                               .progress = tell};
        for (const auto& [name, value] : edits) options.edits.emplace_back(name, settingText(name, value));
        const std::filesystem::path from = pathFrom(input, "input"), to = pathFrom(output, "output");
        const py::gil_scoped_release release;
        return convert(from, to, options);
      },
      "input"_a, "output"_a, py::kw_only(), "overwrite"_a = false, "quantize"_a = false, "meshopt"_a = false,
      "measure"_a = false, "steps"_a = py::none(), "edits"_a = py::list(), "target_size"_a = py::none(),
      "target_psnr"_a = py::none(), "texture_step"_a = py::none(), "cameras"_a = true, "views"_a = py::list(),
      "base_only"_a = false, "lean"_a = false, "atlas"_a = py::none(), "spz_version"_a = py::none(),
      "spz_axes"_a = py::none(), "viewer"_a = py::none(), "viewer_aim"_a = py::none(), "dry_run"_a = false,
      "progress"_a = py::none(),
      R"(A model's file to the format of the other's extension. Options are tgconvert's flags, which messages name.

overwrite: a file that is there. quantize, meshopt: .glb, .gltf and .html with integers, and compressed by
EXT_meshopt_compression. measure: --psnr, draw both models and compare. steps: of .sog, .glb, .gltf and .html, how many
times as wide as usual the steps of all numbers are, 1/8 to 64. edits: names and values of flags, in this order:
[("scale", 2), ("upright", "")], values as settings: numbers, and str, bytes or os.PathLike. target_size, target_psnr:
instead of steps, the finest with which the file has at most this size [bytes], or the coarsest with which pictures of
up to four views come so near to the edited source's [dB], 1 to 100. texture_step: between a texture's colours, 1/1024
to 1/2. cameras: False leaves cameras and named views out. views: named views of .glb, .gltf and .html in place of the
source's. base_only: of a .glb, .gltf, .html, .sog, lod-meta or tileset that is read, without its textures. lean: .glb
and .gltf without the numbers that only bring a .ply back bit by bit. atlas: texels of .glb, .gltf, .html and .png as
"png8", "png16", "exr" or "webp". spz_version: 3 or 4. spz_axes: of an .spz that is read, "rub" or "rdf". viewer,
viewer_aim: --for and --for-aim, what viewers without textures show looks right in this one, as "three". dry_run: find
out how large the file would be and write nothing. progress: called as progress(part, done, steps), on this thread,
before and after every step of a "fit" to a viewer and every trial of a "target", of which a second search counts anew;
what it raises ends the conversion.)");
}

}  // namespace

// pybind11 before 2.12 knows the layout of NumPy 1's dtypes only: arrays of NumPy 2 would all have strides of 0.
void requireNumpy() {
#if PYBIND11_VERSION_HEX < 0x020C0000
  const std::string version = py::str(py::module_::import("numpy").attr("__version__"));
  if (std::stoi(version) >= 2) {
    throw py::import_error("textured_gaussians was built with pybind11 before 2.12, which knows NumPy 1 only (found " +
                           version + "): build it with a newer pybind11");
  }
#endif
}

PYBIND11_MODULE(_core, module) {
  requireNumpy();
  bindError(module);
  bindCamera(module);
  bindModel(module);
  bindRendering(module);
  bindTraining(module);
  bindEvaluation(module);
  module.attr("__version__") = version();
  module.attr("pybind11_version") = py::make_tuple(PYBIND11_VERSION_MAJOR, PYBIND11_VERSION_MINOR);
}

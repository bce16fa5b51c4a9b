// SPDX-License-Identifier: Apache-2.0
// The safetensors reader: values, every truncation, every lie a header can tell.
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/file/file.h"
#include "core/file/safetensors.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

using tg::Safetensors;

namespace {

std::vector<std::uint8_t> file(const std::string& header, const std::vector<std::uint8_t>& data) {
  std::vector<std::uint8_t> bytes(8 + header.size());
  const std::uint64_t length = header.size();
  std::memcpy(bytes.data(), &length, 8);
  std::memcpy(bytes.data() + 8, header.data(), header.size());
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

std::vector<std::uint8_t> floats(const std::vector<float>& values) {
  std::vector<std::uint8_t> bytes(values.size() * 4);
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

std::string refusal(const std::string& header, const std::vector<std::uint8_t>& data = floats({1, 2, 3, 4, 5, 6})) {
  return tg::test::messageOf([&] {
    const Safetensors tensors = Safetensors::parse(file(header, data), "w.safetensors");
    for (const std::string& name : tensors.names()) (void)tensors.tensor(name);
  });
}

}  // namespace

TEST_CASE("reads F32 and F16 tensors by name", "[safetensors]") {
  std::vector<std::uint8_t> data = floats({1, -2, 3, 4, 5, 6.5f});
  // 1, -2, the smallest subnormal, 65504: the largest half.
  for (const std::uint16_t half : std::initializer_list<std::uint16_t>{0x3c00, 0xc000, 0x0001, 0x7bff}) {
    data.push_back(static_cast<std::uint8_t>(half & 255));
    data.push_back(static_cast<std::uint8_t>(half >> 8));
  }
  const Safetensors tensors = Safetensors::parse(
      file(R"({"__metadata__":{"format":"pt"},"a":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]},)"
           R"("h":{"dtype":"F16","shape":[4],"data_offsets":[24,32]},"none":{"dtype":"F32","shape":[0,7],)"
           R"("data_offsets":[32,32]}}  )",
           data),
      "w.safetensors");
  CHECK(tensors.names() == std::vector<std::string>{"a", "h", "none"});
  const tg::Tensor a = tensors.tensor("a");
  CHECK(a.shape == std::vector<std::int64_t>{2, 3});
  CHECK(a.values == std::vector<float>{1, -2, 3, 4, 5, 6.5f});
  CHECK(tensors.tensor("h").values == std::vector<float>{1, -2, std::ldexp(1.0f, -24), 65504});
  CHECK(tensors.tensor("none").values.empty());
  CHECK_THROWS_WITH(tensors.tensor("b"), Contains("w.safetensors: tensor 'b' is missing"));
}

TEST_CASE("passes over tensors of types that are not read", "[safetensors]") {
  const std::pair<int, std::vector<const char*>> sized[] = {{8, {"F64", "I64", "U64"}},
                                                            {4, {"F32", "I32", "U32"}},
                                                            {2, {"F16", "BF16", "I16", "U16"}},
                                                            {1, {"I8", "U8", "BOOL", "F8_E4M3", "F8_E5M2"}}};
  for (const auto& [bytes, types] : sized) {
    for (const char* type : types) {
      const std::string header = std::string(R"({"a":{"dtype":")") + type + R"(","shape":[3],"data_offsets":[0,)" +
                                 std::to_string(3 * bytes) + "]}}";
      const Safetensors tensors = Safetensors::parse(file(header, floats({1, 2, 3, 4, 5, 6})), type);
      CHECK(tensors.names() == std::vector<std::string>{"a"});
    }
  }
}

TEST_CASE("refuses headers that lie, before any allocation", "[safetensors]") {
  CHECK(refusal(R"({"a":{"dtype":"F32","shape":[6],"data_offsets":[0,24]}})") == "accepted");
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[6],"data_offsets":[4,28]}})"), Contains("inside the file's 24"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[6],"data_offsets":[24,0]}})"), Contains("data_offsets"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[6],"data_offsets":[-24,0]}})"), Contains("data_offsets"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[6],"data_offsets":[0,18446744073709551615]}})"),
             Contains("data_offsets"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[5],"data_offsets":[0,24]}})"),
             Contains("differ in length (expected 20 bytes, found 24)"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[4294967296,4294967296,4294967296],"data_offsets":[0,24]}})"),
             Contains("too short for its shape"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[9223372036854775807,2],"data_offsets":[0,24]}})"),
             Contains("too short for its shape"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[-6],"data_offsets":[0,24]}})"), Contains("not a size"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[6.0],"data_offsets":[0,24]}})"), Contains("not a size"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[1,1,1,1,1,1,1,1,6],"data_offsets":[0,24]}})"),
             Contains("not a short list"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F31","shape":[6],"data_offsets":[0,24]}})"), Contains("unknown dtype"));
  CHECK_THAT(refusal(R"({"a":{"dtype":"F64","shape":[3],"data_offsets":[0,24]}})"),
             Contains("cannot use this dtype (expected F32 or F16, found F64)"));
  CHECK_THAT(refusal(R"({"a":7})"), Contains("unknown dtype"));
  CHECK_THAT(refusal("[]"), Contains("not a JSON object"));
  CHECK_THAT(refusal("{"), Contains("not a JSON object"));
  CHECK_THAT(refusal("", {}), Contains("not a JSON object"));  // eight bytes, the least there may be
  CHECK_THAT(refusal(R"({"a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})", floats({NAN})),
             Contains("not finite"));
}

TEST_CASE("names a tensor that it refuses by 80 letters at most", "[safetensors]") {
  const auto refusalOf = [](const std::string& name) {
    return refusal(R"({")" + name + R"(":{"dtype":"F31","shape":[6],"data_offsets":[0,24]}})");
  };
  CHECK(refusalOf("conv1.weight") == "w.safetensors: tensor 'conv1.weight': unknown dtype");
  CHECK(refusalOf(std::string(81, 'n')) == "w.safetensors: tensor '" + std::string(80, 'n') + "': unknown dtype");
}

TEST_CASE("refuses a file of more than 2 GiB unread", "[safetensors]") {
  const tg::TemporaryFolder folder;
  tg::writeFileAtomically(folder / "w.safetensors", std::vector<std::uint8_t>(1));
  std::filesystem::resize_file(folder / "w.safetensors", (std::uintmax_t{2} << 30) + 1);  // no blocks behind the first
  CHECK_THROWS_WITH(Safetensors::read(folder / "w.safetensors"),
                    Contains("too long (expected at most 2147483648 bytes, found 2147483649)"));
}

TEST_CASE("refuses a file that ends anywhere", "[safetensors]") {
  const std::vector<std::uint8_t> whole =
      file(R"({"a":{"dtype":"F32","shape":[2,3],"data_offsets":[0,24]}})", floats({1, 2, 3, 4, 5, 6}));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    CHECK_THROWS_AS(
        Safetensors::parse({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)}, "w.safetensors"),
        tg::Error);
  }
  CHECK_THROWS_WITH(Safetensors::parse(std::vector<std::uint8_t>(64, 255), "w.safetensors"),
                    Contains("expected a header of at most 56 bytes"));
}
